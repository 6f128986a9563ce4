"""The meaning of a bag's topics: the mapping file of a rig, and the names that this project writes itself."""

from __future__ import annotations

from ldcs_ros.errors import MappingError
from ldcs_ros.signals.mapping import CommandSource, Mapping, MeasurementSource, load_mapping
from ldcs_ros.signals.topics import guess_mapping

__all__ = [
    "CommandSource",
    "Mapping",
    "MappingError",
    "MeasurementSource",
    "guess_mapping",
    "load_mapping",
]

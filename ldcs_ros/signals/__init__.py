"""The meaning of a bag's topics or a table's columns: a mapping file, and the names this project writes itself."""

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

"""Models of the rig's sensors: their reports, rates, delays and noise. No ROS here."""

from __future__ import annotations

from ldcs_ros.sensors.pressure import PressureSensor, PressureSensorParameters
from ldcs_ros.sensors.ticks import Ticks
from ldcs_ros.sensors.tracker import Measurement, Tracker, TrackerParameters

__all__ = [
    "Measurement",
    "PressureSensor",
    "PressureSensorParameters",
    "Ticks",
    "Tracker",
    "TrackerParameters",
]

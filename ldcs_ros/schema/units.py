"""Axes, arms, units of pressure, the tolerance of times; it imports nothing, so that a small process can use it."""

from __future__ import annotations

AXES = ("x", "y", "z")
ARM_NAMES = ("left", "right")
"""The arms of a scene or a rig file without a list: along the edges y_max and y_min."""
MAX_ARMS = 16
"""The most arms of a scene or a rig."""
PRESSURE = {
    "Pa": 1.0,
    "hPa": 1e2,
    "mbar": 1e2,
    "kPa": 1e3,
    "bar": 1e5,
    "psi": 6894.757293168361,  # a pound-force, 4.4482216152605 N, on a square inch
}
STANDARD_ATMOSPHERE = 101325.0
"""Pressure of the surrounding air where a source names none [Pa]."""
TIME_TOLERANCE = 2e-9
"""Largest difference of two times that count as one [s]: each stamp is rounded to a nanosecond."""

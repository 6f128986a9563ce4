"""Units that rigs use, as factors to SI."""

from __future__ import annotations

PRESSURE = {
    "Pa": 1.0,
    "hPa": 1e2,
    "mbar": 1e2,
    "kPa": 1e3,
    "bar": 1e5,
    "psi": 6894.757293168361,  # a pound-force, 4.4482216152605 N, on a square inch
}
TORQUE = {"N m": 1.0, "mN m": 1e-3}
FORCE = {"N": 1.0, "mN": 1e-3}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "inch": 0.0254}
ANGLE = {"rad": 1.0, "deg": 0.017453292519943295}

STANDARD_ATMOSPHERE = 101325.0
"""Pressure of the surrounding air when nobody says [Pa]."""

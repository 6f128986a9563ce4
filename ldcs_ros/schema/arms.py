"""Names of a rig's arms where nothing else names them, and how many there may be."""

from __future__ import annotations

ARM_NAMES = ("left", "right")
"""The arms of a scene or a rig file without a list: along the edges y_max and y_min."""
MAX_ARMS = 16

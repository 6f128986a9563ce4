"""Bounds of sensor parameters, checked where a sensor is made."""

from __future__ import annotations

import math

from ldcs_ros.errors import SceneError


def check_range(owner: str, name: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise SceneError unless `value` is a finite number in low ... high."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not low <= value <= high:
        bounds = f"a number {low:g} ... {high:g} {unit}"
        raise SceneError(f"sensors.{owner}.{name} is {value!r}, expected {bounds}; correct it in the scene")

"""A curve through recorded values."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, interp1d

SAME_TIME = 2e-9
"""Times this close are one time [s]: stamps have nanoseconds, times of a simulation are rounded to them."""


def curve(time: np.ndarray, value: np.ndarray, *, smooth: bool) -> Any:
    """Return a callable time -> values, shape (..., k): a cubic spline, or straight lines through noisy values.

    Outside of the times it was made for, it keeps the first and the last value.
    """
    if smooth and len(time) >= 4:
        spline = CubicSpline(time, value, axis=0)
        return lambda asked: spline(np.clip(asked, time[0], time[-1]))
    if len(time) == 1:
        return lambda asked: np.broadcast_to(value[0], (*np.shape(asked), *value.shape[1:]))
    return interp1d(
        time, value, axis=0, assume_sorted=True, bounds_error=False, fill_value=(value[0], value[-1])
    )


def at_times(time: np.ndarray, value: np.ndarray, asked: np.ndarray, through: Any) -> np.ndarray:
    """Return values at some times: those that are there if all are, and else those of a curve `through` them."""
    # Runs of the same scene have the same stamps.
    index = np.clip(np.searchsorted(time, asked - SAME_TIME), 0, len(time) - 1)
    if np.all(np.abs(time[index] - asked) <= SAME_TIME):
        found: np.ndarray = value[index]
        return found
    return np.asarray(through(asked))

"""Two series of one channel at common times, where both have something to say."""

from __future__ import annotations

import numpy as np

from ldcs_ros.signals.interpolate import SAME_TIME, at_times
from ldcs_ros.signals.series import Series

# Where a series is silent for this many of its usual periods, nothing is made up between its values.
GAP_PERIODS = 5.0


def common(
    a: Series, b: Series, offset: float, *, most: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return times on A's clock, both sides' values there, and how many times fell into gaps.

    The times are those of the noisier side, or else of the sparser one: noise is never interpolated if the
    other side is smooth.

    Args:
        a: One side.
        b: The other side; something at t on A's clock has t + offset on B's.
        offset: What B's clock is ahead of A's [s].
        most: Times at most, evenly chosen; None for all.
    """
    by_a = _leads(a, b)
    lead, other, shift = (a, b, offset) if by_a else (b, a, -offset)
    start, end = other.time[0] - shift - SAME_TIME, other.time[-1] - shift + SAME_TIME
    index = np.flatnonzero((lead.time >= start) & (lead.time <= end))
    if most is not None and len(index) > most:
        index = index[np.linspace(0, len(index) - 1, most).astype(int)]
    asked = lead.time[index] + shift
    known = _covered(other.time, asked)
    skipped = len(index) - int(known.sum())
    index, asked = index[known], asked[known]
    led, at = lead.value[index], at_times(other.time, other.value, asked, other.curve)
    return (lead.time[index], led, at, skipped) if by_a else (asked, at, led, skipped)


def _leads(a: Series, b: Series) -> bool:
    if a.smooth != b.smooth:
        return b.smooth
    return len(a.time) <= len(b.time)


def _covered(known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    if len(known) < 3:
        return np.ones(len(asked), dtype=bool)
    longest = GAP_PERIODS * float(np.median(np.diff(known)))
    right = np.clip(np.searchsorted(known, asked), 1, len(known) - 1)
    near = np.minimum(np.abs(asked - known[right - 1]), np.abs(asked - known[right])) <= SAME_TIME
    covered: np.ndarray = near | (known[right] - known[right - 1] <= longest)
    return covered

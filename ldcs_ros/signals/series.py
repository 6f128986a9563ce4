"""Series: the values of one channel over time, curves through them, and two series at common times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, interp1d

from ldcs_ros.schema.units import TIME_TOLERANCE

Curve = Callable[[np.ndarray], np.ndarray]
"""Times [s] of any shape -> values, shape (..., k)."""


def curve(time: np.ndarray, value: np.ndarray, *, smooth: bool) -> Curve:
    """Return a callable time -> values, shape (..., k): a cubic spline, or straight lines through noisy values.

    Outside of the times it was made for, it keeps the first and the last value.
    """
    if smooth and len(time) >= 4:
        spline = CubicSpline(time, value, axis=0)
        return lambda asked: spline(np.clip(asked, time[0], time[-1]))
    if len(time) == 1:
        return lambda asked: np.broadcast_to(value[0], (*np.shape(asked), *value.shape[1:]))
    lines: Curve = interp1d(
        time, value, axis=0, assume_sorted=True, bounds_error=False, fill_value=(value[0], value[-1])
    )
    return lines


def at_times(time: np.ndarray, value: np.ndarray, asked: np.ndarray, through: Curve) -> np.ndarray:
    """Return values at asked times, shape (k,) or (k, m): known ones if all times are known, else those of a curve."""
    # Runs of the same scene have the same stamps.
    index = np.clip(np.searchsorted(time, asked - TIME_TOLERANCE), 0, len(time) - 1)
    if np.all(np.abs(time[index] - asked) <= TIME_TOLERANCE):
        found: np.ndarray = value[index]
        return found
    return np.asarray(through(asked))


@dataclass(frozen=True)
class Series:
    """Values of one channel over time.

    Attributes:
        time: Times [s], shape (n,), rising without repetition.
        value: Values in SI units, shape (n, k).
        axes: Names of the k components; ('',) for a scalar.
        unit: 'm', 'Pa' or 'rad'.
        smooth: Free of noise, so that a smooth curve through the values is a better guess than a straight one.
    """

    time: np.ndarray
    value: np.ndarray
    axes: tuple[str, ...]
    unit: str
    smooth: bool

    @cached_property
    def curve(self) -> Curve:
        """A callable time [s] -> values, shape (..., k)."""
        return curve(self.time, self.value, smooth=self.smooth)


def clean(time: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return finite times, shape (n,), and values, (n, m), in order, each time once, and how many were dropped."""
    kept = np.isfinite(value).all(axis=1)
    order = np.argsort(time[kept], kind="stable")
    time_kept, value_kept = time[kept][order], value[kept][order]
    first = np.append(True, np.diff(time_kept) > 0.0) if len(time_kept) else np.zeros(0, dtype=bool)
    return time_kept[first], value_kept[first], len(time) - int(first.sum())


# A value stands alone if it is so many usual distances from the median of it and its neighbours, twice as far as those.
SPIKE = 8.0
_NEIGHBOURS = 5


def without_spikes(series: Series, least: float) -> Series:
    """Return a series without the values that stand alone (Hampel's filter); the last ones at each end are kept.

    Args:
        series: A series.
        least: Distance from the median of the neighbours up to which each value is kept, in the unit of the series.
    """
    if len(series.time) <= _NEIGHBOURS:
        return series
    windows = np.lib.stride_tricks.sliding_window_view
    reach = _NEIGHBOURS // 2
    apart = np.zeros_like(series.value)
    around = np.median(windows(series.value, _NEIGHBOURS, axis=0), axis=-1)
    apart[reach:-reach] = np.abs(series.value[reach:-reach] - around)
    far = apart > np.maximum(least, SPIKE * np.median(apart, axis=0))
    # Fast motion has such values close together.
    padded = np.pad(apart, ((2 * reach, 2 * reach), (0, 0)))
    second = np.sort(windows(padded, 4 * reach + 1, axis=0), axis=-1)[..., -2]
    alone = (far & (apart > 2.0 * second)).any(axis=1)
    return replace(series, time=series.time[~alone], value=series.value[~alone])


# Nothing is interpolated across a silence of this many usual periods of a series.
GAP_PERIODS = 5.0


def resample_common(
    a: Series, b: Series, offset: float, *, most: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return times on A's clock, shape (n,), both sides' values there, shape (n, k), and the number of times in gaps.

    The times are those of the noisier side, or else of the sparser one: noise is never interpolated if the
    other side is smooth.

    Args:
        a: One side.
        b: The other side; an event at t on A's clock has t + offset on B's.
        offset: Lead of B's clock over A's [s].
        most: Times at most, evenly chosen; None for all.
    """
    by_a = reference_is_first(a, b)
    lead, other, shift = (a, b, offset) if by_a else (b, a, -offset)
    start, end = other.time[0] - shift - TIME_TOLERANCE, other.time[-1] - shift + TIME_TOLERANCE
    index = np.flatnonzero((lead.time >= start) & (lead.time <= end))
    if most is not None and len(index) > most:
        index = index[np.linspace(0, len(index) - 1, most).astype(int)]
    asked = lead.time[index] + shift
    known = covered(other.time, asked)
    skipped = len(index) - int(known.sum())
    index, asked = index[known], asked[known]
    led, at = lead.value[index], at_times(other.time, other.value, asked, other.curve)
    return (lead.time[index], led, at, skipped) if by_a else (asked, at, led, skipped)


def reference_is_first(a: Series, b: Series) -> bool:
    """Return whether the times of A are the common ones: those of the noisier series, or else of the sparser one."""
    if a.smooth != b.smooth:
        return b.smooth
    return len(a.time) <= len(b.time)


def covered(known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return which of the asked times [s] are in no silence of the known ones, shape (n,)."""
    if len(known) < 3:
        return np.ones(len(asked), dtype=bool)
    longest = GAP_PERIODS * float(np.median(np.diff(known)))
    right = np.clip(np.searchsorted(known, asked), 1, len(known) - 1)
    near = np.minimum(np.abs(asked - known[right - 1]), np.abs(asked - known[right])) <= TIME_TOLERANCE
    found: np.ndarray = near | (known[right] - known[right - 1] <= longest)
    return found

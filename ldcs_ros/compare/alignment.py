"""The constant offset between two clocks, estimated from the motion in both recordings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from ldcs_ros.signals.series import Series, resample_common, without_spikes

# Two recordings must overlap in at least this fraction of the shorter one.
LEAST_OVERLAP = 0.5
# Largest unexplained fraction of the motion's variance at which the offset is believed.
BELIEVED = 0.5
COARSE_STEPS = 400
FINE_STEPS = 20
# Minima of the coarse search that are refined, and how much more of the variance than at the lowest may remain there.
MOST_MINIMA = 12
NEAR_REST = 0.1
# Refined minima are equal if so much more of the variance remains, or so much more of what remains at the lowest.
EQUAL_REST = 0.005
EQUAL_RATIO = 0.1
MOST_ALTERNATIVES = 4
# Times of a channel that each offset is tried at.
MOST_TIMES = 1000
# An offset below this is none [s].
RESOLUTION = 1e-5
# Motion below this carries no information about time.
STILL = {"m": 2e-4, "Pa": 1e3, "rad": 5e-3}


@dataclass(frozen=True)
class Offset:
    """The offset of two clocks.

    Attributes:
        value: Lead of B's clock over A's, as used [s].
        estimate: Estimate from the motion [s]; None without enough motion.
        uncertainty: Standard deviation of the estimate, for differences without memory [s].
        unexplained: Fraction of the motion's variance that remains at the estimate, 0 ... 1.
        channels: Channels that it rests on.
        alternatives: Other offsets that explain a periodic motion as well, the nearest first [s].
        reason: Reason of this value, in words.
    """

    value: float
    estimate: float | None = None
    uncertainty: float | None = None
    unexplained: float | None = None
    channels: tuple[str, ...] = ()
    alternatives: tuple[float, ...] = ()
    reason: str = ""


Pair = tuple[Series, Series]


def estimate_offset(pairs: dict[str, Pair]) -> Offset:
    """Return the offset at which two recordings agree best; a constant difference of a channel does not count.

    The criterion is the variance of the differences over that of the values. A coarse search covers all offsets that
    leave enough in common. A fine search around the best one also fits the size of each component, because a motion
    that is too large is no error of a clock. Values that stand alone are left out. A periodic motion has several equal
    minima: the smallest offset is used, and the others are named. An offset within its uncertainty is none.
    """
    pairs = {
        name: (without_spikes(a, STILL[a.unit]), without_spikes(b, STILL[b.unit]))
        for name, (a, b) in pairs.items()
    }
    moving = _informative(pairs)
    if not moving:
        return Offset(0.0, reason="nothing moves enough in both to estimate an offset: 0 is assumed")
    scaled = [(pair, _motion(pair[0]) + _motion(pair[1])) for pair in moving.values()]
    first, last = _range(list(moving.values()))
    step = (last - first) / COARSE_STEPS
    offsets = first + step * np.arange(COARSE_STEPS + 1)
    remaining = np.array([_unexplained(scaled, float(offset), with_gain=False) for offset in offsets])
    found = [_refined(scaled, float(offsets[k]), step) for k in _minima(remaining)]
    least = min(rest for _, rest in found)
    equal = [offset for offset, rest in found if rest <= least + max(EQUAL_REST, EQUAL_RATIO * least)]
    best, *others = sorted(equal, key=abs)
    rest = _unexplained(scaled, best, with_gain=False)
    channels = tuple(moving)
    if rest > BELIEVED:
        return Offset(
            0.0,
            best,
            None,
            rest,
            channels,
            reason="the two motions have too little in common: 0 is assumed",
        )
    alternatives: list[float] = []
    for other in others:
        if all(abs(other - known) > 2.0 * step for known in (best, *alternatives)):
            alternatives.append(other)
    uncertainty = _uncertainty(list(moving.values()), best)
    if abs(best) <= max(RESOLUTION, uncertainty or 0.0):
        best = 0.0
    return Offset(
        best,
        best,
        uncertainty,
        rest,
        channels,
        tuple(alternatives[:MOST_ALTERNATIVES]),
        "estimated from motion",
    )


def _minima(remaining: np.ndarray) -> list[int]:
    """Return the lowest minima of the coarse search, the lowest first."""
    padded = np.concatenate(([np.inf], remaining, [np.inf]))
    lowest = np.flatnonzero((padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]))
    ordered = lowest[np.argsort(remaining[lowest], kind="stable")][:MOST_MINIMA]
    return [int(k) for k in ordered if remaining[k] <= remaining[ordered[0]] + NEAR_REST]


def _refined(scaled: list[tuple[Pair, float]], coarse: float, step: float) -> tuple[float, float]:
    """Return the offset of the minimum near a coarse one, and the fraction of the variance that remains there."""
    best = _best(scaled, coarse + step * np.arange(-FINE_STEPS, FINE_STEPS + 1), with_gain=True)
    found = minimize_scalar(
        lambda shift: _unexplained(scaled, best + shift, with_gain=True),
        bounds=(-step, step),
        method="bounded",
        options={"xatol": 1e-6},
    )
    best += float(found.x)
    return best, _unexplained(scaled, best, with_gain=True)


def _best(scaled: list[tuple[Pair, float]], offsets: np.ndarray, *, with_gain: bool) -> float:
    return float(
        offsets[int(np.argmin([_unexplained(scaled, float(o), with_gain=with_gain) for o in offsets]))]
    )


def _unexplained(scaled: list[tuple[Pair, float]], offset: float, *, with_gain: bool) -> float:
    """Return the fraction of the variance that remains: 0 for the same motion, about 1 for nothing in common.

    Args:
        scaled: Pairs, each with its variance, so that all channels count alike.
        offset: The offset to try [s].
        with_gain: Let the size of each component's motion be fitted.
    """
    left, total = 0.0, 0.0
    for (a, b), scale in scaled:
        time, ours, theirs, _ = resample_common(a, b, offset, most=MOST_TIMES)
        if len(time) < 4:
            return 1.0
        both = np.var(ours, axis=0) + np.var(theirs, axis=0)
        apart = np.var(ours - theirs, axis=0)
        if with_gain:
            product = 0.5 * (both - apart)  # the covariance
            squares = np.var(ours, axis=0) * np.var(theirs, axis=0)
            apart = both * (1.0 - np.where(squares > 0.0, product**2 / np.maximum(squares, 1e-300), 0.0))
        left += float(apart.sum()) / scale
        total += float(both.sum()) / scale
    # Two records without motion agree at any offset.
    return left / total if total > 0.05 * len(scaled) else 1.0


def _informative(pairs: dict[str, Pair]) -> dict[str, Pair]:
    """Return the channels that move: points if there are any, since each kind of sensor has a delay of its own."""
    moving = {name: pair for name, pair in pairs.items() if _moves(pair)}
    for unit in STILL:
        of_unit = {name: pair for name, pair in moving.items() if pair[0].unit == unit}
        if of_unit:
            return of_unit
    return {}


def _moves(pair: Pair) -> bool:
    a, b = pair
    limit = STILL[a.unit]
    return len(a.time) > 3 and len(b.time) > 3 and min(_spread(a), _spread(b)) > limit


def _spread(series: Series) -> float:
    # Between percentiles, so that noise and a few wild values are no motion.
    low, high = np.percentile(series.value, [5, 95], axis=0)
    return float(np.max(high - low))


def _motion(series: Series) -> float:
    return float(np.var(series.value, axis=0).sum())


def _range(pairs: list[Pair]) -> tuple[float, float]:
    """Return the offsets at which every channel still has enough in common."""
    first, last = -np.inf, np.inf
    for a, b in pairs:
        need = LEAST_OVERLAP * min(a.time[-1] - a.time[0], b.time[-1] - b.time[0])
        first = max(first, b.time[0] - a.time[-1] + need)
        last = min(last, b.time[-1] - a.time[0] - need)
    return float(first), float(max(first, last))


def _uncertainty(pairs: list[Pair], offset: float) -> float | None:
    """Return the standard deviation of the offset from the differences left and the speeds, as in least squares."""
    information = 0.0
    for a, b in pairs:
        time, ours, theirs, _ = resample_common(a, b, offset)
        if len(time) < 5:
            continue
        noise = np.var(ours - theirs, axis=0) + 1e-18
        smooth = ours if a.smooth else theirs
        speed = np.gradient(smooth, time, axis=0)
        information += float((speed**2 / noise).sum())
    return information**-0.5 if information > 0.0 else None

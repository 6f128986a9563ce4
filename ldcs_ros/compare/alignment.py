"""The constant offset between two clocks, estimated from the motion that both saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from ldcs_ros.compare.resample import common
from ldcs_ros.compare.side import Series

# Two recordings must share at least this part of the shorter one.
LEAST_OVERLAP = 0.5
# Of the motion's variance, what may remain unexplained when the offset is believed.
BELIEVED = 0.5
COARSE_STEPS = 400
# Times of a channel that are looked at for each offset tried.
MOST_TIMES = 1000
# Motion below this says nothing about time.
STILL = {"m": 2e-4, "Pa": 1e3, "rad": 5e-3}


@dataclass(frozen=True)
class Offset:
    """How two clocks stand.

    Attributes:
        value: What B's clock is ahead of A's, as it is used [s].
        estimate: What the motion says [s]; None if it says nothing.
        uncertainty: Standard deviation of the estimate, for differences without memory [s].
        unexplained: Part of the motion's variance that remains at the estimate, 0 ... 1.
        channels: Channels that it rests on.
        reason: Why this value is used, in words.
    """

    value: float
    estimate: float | None = None
    uncertainty: float | None = None
    unexplained: float | None = None
    channels: tuple[str, ...] = ()
    reason: str = ""


Pair = tuple[Series, Series]


def estimate_offset(pairs: dict[str, Pair]) -> Offset:
    """Return the offset at which two recordings agree best; constant differences of a channel do not count.

    The measure is the variance of the differences over that of the values themselves, over all channels that
    move, each in units of its own motion: 0 for the same motion, about 1 for two that have nothing in common.
    """
    moving = {name: pair for name, pair in pairs.items() if _moves(pair)}
    if not moving:
        return Offset(0.0, reason="nothing moves enough in both to estimate an offset: 0 is assumed")
    scale = {name: _motion(a) + _motion(b) for name, (a, b) in moving.items()}

    def unexplained(offset: float) -> float:
        left, total = 0.0, 0.0
        for name, (a, b) in moving.items():
            time, ours, theirs, _ = common(a, b, offset, most=MOST_TIMES)
            if len(time) < 4:
                return 1.0
            left += float(np.var(ours - theirs, axis=0).sum()) / scale[name]
            total += float((np.var(ours, axis=0) + np.var(theirs, axis=0)).sum()) / scale[name]
        # Where neither moves, two records agree at any offset.
        return left / total if total > 0.05 * len(moving) else 1.0

    first, last = _range(list(moving.values()))
    step = (last - first) / COARSE_STEPS
    lags = first + step * np.arange(COARSE_STEPS + 1)
    best = float(lags[int(np.argmin([unexplained(float(lag)) for lag in lags]))])
    for reach in (step, 0.05 * step):
        found = minimize_scalar(
            unexplained,
            bounds=(best - reach, best + reach),
            method="bounded",
            options={"xatol": 1e-3 * reach},
        )
        best = float(found.x)
    rest = unexplained(best)
    channels = tuple(moving)
    if rest > BELIEVED:
        return Offset(
            0.0, best, None, rest, channels, "the two motions have too little in common: 0 is assumed"
        )
    return Offset(
        best, best, _uncertainty(list(moving.values()), best), rest, channels, "estimated from motion"
    )


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
        time, ours, theirs, _ = common(a, b, offset)
        if len(time) < 5:
            continue
        noise = np.var(ours - theirs, axis=0) + 1e-18
        smooth = ours if a.smooth else theirs
        speed = np.gradient(smooth, time, axis=0)
        information += float((speed**2 / noise).sum())
    return information**-0.5 if information > 0.0 else None

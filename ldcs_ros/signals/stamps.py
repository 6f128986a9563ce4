"""Header stamps on the recorder's clock: unset, stuck and coarse ones replaced, other and stepped clocks taken out."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

SECOND = 1_000_000_000
ANOTHER_CLOCK = SECOND
"""Stamps that differ from the recorder's time by more than this are of another clock [ns]."""
SMALLEST_STEP = SECOND // 20
"""Steps of the stamps' clock up to this are taken for changes of the delay [ns]."""
MOST_PERIODS = 5.0
"""Usual periods after which the copy of a message counts as a new one with a stamp that is stuck."""
COARSE_SPREAD = SECOND // 10
"""Delays of stamps in whole seconds that differ by more than this show that the stamps are rounded [ns]."""
LEAST_MESSAGES = 3
"""Messages that show that a clock was set; fewer are late, or wrong alone."""


@dataclass(frozen=True)
class StampedTimes:
    """The times of messages, on the recorder's clock.

    Attributes:
        time: Times [ns], shape (n,).
        usable: The time is that of the stamp, shape (n,); else it follows from the log time.
        clock_offset: First lead of the stamps' clock over the recorder's [ns]; None if it is the same.
        clock_steps: Each step of the stamps' clock during the recording [ns].
    """

    time: np.ndarray
    usable: np.ndarray
    clock_offset: int | None
    clock_steps: tuple[int, ...]


def on_recorders_clock(stamps: np.ndarray, logs: np.ndarray, copies: np.ndarray) -> StampedTimes:
    """Return when the messages of one source hold.

    Args:
        stamps: Stamps in log order, 0 where none was set [ns], shape (n,).
        logs: Log times, ascending [ns], shape (n,).
        copies: The bytes of the message are those of the first one with its stamp, shape (n,).
    """
    usable = _telling(stamps, logs, copies)
    if not usable.any():
        return StampedTimes(logs.copy(), usable, None, ())
    index = np.flatnonzero(usable)
    ahead = stamps[index] - logs[index]
    level = np.zeros(len(stamps), dtype=np.int64)
    typical = np.zeros(len(stamps), dtype=np.int64)
    latest = np.zeros(len(stamps), dtype=np.int64)
    bounds = _clock_changes(ahead, logs[index])
    parts = [_Lead.of(ahead[first:end]) for first, end in bounds]
    base = _base(parts)
    levels = [0 if abs(part.fastest - base) <= SMALLEST_STEP else part.fastest - base for part in parts]
    for (first, end), part, lead in zip(bounds, parts, levels, strict=True):
        covered = slice(index[first] if first else 0, index[end] if end < len(index) else len(stamps))
        level[covered], typical[covered], latest[covered] = lead, part.middle, part.middle + part.scatter
    # A stamp from the future is wrong by itself; one from the past may be a message that came late.
    usable &= ~((stamps > 0) & (stamps - logs > latest))
    time = np.where(usable, stamps - level, logs + typical - level)
    steps = tuple(int(after - before) for before, after in itertools.pairwise(levels))
    return StampedTimes(time, usable, levels[0] or None, steps)


def _telling(stamps: np.ndarray, logs: np.ndarray, copies: np.ndarray) -> np.ndarray:
    """Tell which stamps say when their message was made."""
    # A simulation starts at 0: a stamp of 0 that was logged then is a time.
    usable = (stamps > 0) | (logs == 0)
    distinct, first, inverse = np.unique(stamps, return_index=True, return_inverse=True)
    since = logs - logs[first][inverse]
    repeated = usable & (since > 0)
    whole = usable.sum() >= LEAST_MESSAGES and not (stamps[usable] % SECOND).any()
    if whole and (repeated.any() or np.ptp((stamps - logs)[usable]) > COARSE_SPREAD):
        return np.zeros(len(stamps), dtype=bool)
    # A copy follows soon; a stamp that stays while other stamps would come and go is stuck.
    usual = np.median(np.diff(distinct[distinct > 0])) if (distinct > 0).sum() > 1 else 0.0
    usable &= ~repeated | (copies & (since <= MOST_PERIODS * usual))
    return usable


@dataclass(frozen=True)
class _Lead:
    """The lead of the stamps' clock over the recorder's in a part of a recording [ns].

    Attributes:
        middle: Its median.
        scatter: Largest distance above the median that varying delays explain.
        fastest: Lead of the message that came fastest: it shows best how the two clocks stand.
    """

    middle: int
    scatter: int
    fastest: int

    @classmethod
    def of(cls, ahead: np.ndarray) -> _Lead:
        middle = int(np.sort(ahead)[len(ahead) // 2])  # a mean of two would be rounded as float64
        scatter = int(np.clip(MOST_PERIODS * _spread(ahead), SMALLEST_STEP, ANOTHER_CLOCK))
        return cls(middle, scatter, int(ahead[ahead <= middle + scatter].max()))


def _clock_changes(ahead: np.ndarray, logs: np.ndarray) -> list[tuple[int, int]]:
    """Return the ranges between which the stamps' clock was set."""
    jumps, periods = np.abs(np.diff(ahead)), np.diff(logs)
    # Where the recorder heard nothing for a while, a small jump is a change of the delay.
    steady_log = periods <= 2.0 * np.median(periods) if len(periods) else np.zeros(0, dtype=bool)
    cut = jumps > np.where(steady_log, SMALLEST_STEP, ANOTHER_CLOCK)
    cuts = [0, *(np.flatnonzero(cut) + 1), len(ahead)]
    ranges: list[tuple[int, int]] = []
    for first, end in itertools.pairwise(cuts):
        part = ahead[first:end]
        jump = min(int(jumps[first - 1]), ANOTHER_CLOCK) if first else ANOTHER_CLOCK
        # Messages that were held up and come at once catch up with the clock: no level.
        steady = end - first >= LEAST_MESSAGES and _spread(part) < jump / 4
        known = ranges and abs(np.median(part) - np.median(ahead[slice(*ranges[-1])])) <= jump / 2
        if ranges and (not steady or known):
            ranges[-1] = ranges[-1][0], int(end)
        else:
            ranges.append((int(first), int(end)))
    if len(ranges) > 1 and ranges[0][1] - ranges[0][0] < LEAST_MESSAGES:
        ranges[:2] = [(0, ranges[1][1])]
    return ranges


def _spread(ahead: np.ndarray) -> float:
    """Return the distance of the quartiles [ns]."""
    return float(np.subtract(*np.percentile(ahead, [75, 25])))


def _base(parts: list[_Lead]) -> int:
    """Return the lead in the part that the recorder's own clock stamped; 0 if there is none of it."""
    own = [part.fastest for part in parts if abs(part.middle) <= ANOTHER_CLOCK]
    return min(own, key=abs, default=0)

"""Header stamps on the recorder's clock: unset, stuck and coarse ones replaced, other and stepped clocks taken out."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

SECOND = 1_000_000_000
ANOTHER_CLOCK = SECOND
"""Stamps that differ from the recorder's time by more than this are of another clock [ns]."""
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
    bounds = _clock_changes(ahead)
    levels: list[int] = []
    base = _base(ahead, bounds)
    for first, end in bounds:
        part = ahead[first:end]
        middle = int(np.sort(part)[len(part) // 2])  # a mean of two would be rounded as float64
        # The message that came fastest shows best how the two clocks stand.
        fastest = int(part[part <= middle + ANOTHER_CLOCK].max())
        levels.append(0 if abs(middle) <= ANOTHER_CLOCK else fastest - base)
        start, stop = (index[first] if first else 0), (index[end] if end < len(index) else len(stamps))
        level[start:stop], typical[start:stop] = levels[-1], middle
    # A stamp from the future is wrong by itself; one from the past may be a message that came late.
    usable &= ~((stamps > 0) & (stamps - logs > typical + ANOTHER_CLOCK))
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


def _clock_changes(ahead: np.ndarray) -> list[tuple[int, int]]:
    """Return the ranges between which the stamps' clock was set."""
    cuts = [0, *(np.flatnonzero(np.abs(np.diff(ahead)) > ANOTHER_CLOCK) + 1), len(ahead)]
    ranges: list[tuple[int, int]] = []
    for first, end in itertools.pairwise(cuts):
        part = ahead[first:end]
        # Messages that were held up and come at once catch up with the clock: no level.
        steady = (
            end - first >= LEAST_MESSAGES and np.subtract(*np.percentile(part, [75, 25])) < ANOTHER_CLOCK / 4
        )
        known = ranges and abs(np.median(part) - np.median(ahead[slice(*ranges[-1])])) <= ANOTHER_CLOCK
        if ranges and (not steady or known):
            ranges[-1] = ranges[-1][0], int(end)
        else:
            ranges.append((int(first), int(end)))
    if len(ranges) > 1 and ranges[0][1] - ranges[0][0] < LEAST_MESSAGES:
        ranges[:2] = [(0, ranges[1][1])]
    return ranges


def _base(ahead: np.ndarray, bounds: list[tuple[int, int]]) -> int:
    """Return what the fastest message of the recorder's own clock is ahead; 0 if there is none of it."""
    own = [ahead[first:end] for first, end in bounds if abs(np.median(ahead[first:end])) <= ANOTHER_CLOCK]
    return int(max(part.max() for part in own)) if own else 0

"""Clocks of a rig against the bridge's steady clock: offset, latency, jumps."""

from __future__ import annotations

import math
import threading
from collections import deque

JUMP = 0.15
"""Smallest disagreement of stamps that is taken for a clock jump, not for a late message [s]."""
_WINDOW = 30.0
_ROUND_TRIPS = 200
_SMOOTHING = 0.05
_ANSWER_LIFETIME = 1.0  # s
_FASTEST_DRIFT = 1e-3  # s per second: a larger divergence of two clocks is latency


class ClockEstimate:
    """An estimate of one source's clock from its stamps.

    Messages that only come in (one way) give offset and latency as a sum: the smallest of arrival minus
    stamp over the last messages is taken as the offset, and what a message took longer as its latency. The offset
    rises no faster than clocks drift: readings that come later and later are old, not the clock slow. If
    the bridge asks and the rig answers with a stamp, half of the shortest round trip separates them
    (Cristian 1989). A clock jump is a stamp further back than the one before, twice in a row for messages that
    only come in, or an arrival long before its time.

    Attributes:
        offset: Bridge's clock minus the rig's [s]; None while no stamp came.
        latency: Smoothed time on the way, above the shortest one for a rig without answers [s].
        worst_latency: Largest since it was last taken [s].
        jumps: Clock jumps seen.
        last_jump: Size of the last one, positive when the rig's clock went forward [s].
    """

    def __init__(self) -> None:
        self.offset: float | None = None
        self.latency = 0.0
        self.worst_latency = 0.0
        self.jumps = 0
        self.last_jump = 0.0
        self._smallest = _SlidingMinimum()
        self._round_trips: deque[tuple[float, float]] = deque(maxlen=_ROUND_TRIPS)
        self._offset_time = 0.0
        self._last_stamp: float | None = None
        self._last_answer: float | None = None
        self._answered_at = -math.inf
        self._backward_count = 0
        self._lock = threading.Lock()  # a link's thread and the bridge's both report

    def one_way(self, stamp: float, received: float) -> bool:
        """Take the rig's stamp [s] of a message that came at `received` [s]; False while it is not reliable."""
        difference = received - stamp
        with self._lock:
            # Answers separate jumps from lateness better; readings decide only while nothing is asked.
            asked = received - self._answered_at < _ANSWER_LIFETIME
            if not asked and self._jumped(stamp, difference):
                return False
            smallest = self._smallest.take(received, difference)
            if self.offset is None:
                self.offset = smallest
            elif not self._round_trips:
                self.offset = self._slowed(smallest, received)
            self._offset_time = max(self._offset_time, received)
            self._count_latency(difference - self.offset)
        return True

    def round_trip(self, sent: float, stamp: float, received: float) -> None:
        """Take the stamp [s] of an answer to a question that was asked at `sent` and answered at `received` [s]."""
        duration, offset = received - sent, 0.5 * (sent + received) - stamp
        with self._lock:
            believed = self.offset if self._round_trips else None
            if believed is not None:
                ahead = offset < believed - JUMP - 0.5 * duration
                backward = self._last_answer is not None and stamp < self._last_answer - JUMP
                if ahead or backward:
                    self._restart(believed - offset)
                    believed = None
            self._round_trips.append((duration, offset))
            best = min(self._round_trips)[1]
            # An answer whose stamp is later and later is old: a clock does not slow down that much.
            self.offset = best if believed is None else self._slowed(best, received)
            self._offset_time = max(self._offset_time, received)
            self._last_answer, self._answered_at = stamp, received
            self._last_stamp = None
            self._count_latency(received - stamp - self.offset)

    def local(self, stamp: float) -> float:
        """Return a stamp of the rig on the bridge's clock [s].

        Raises:
            ValueError: No stamp has been taken yet.
        """
        if self.offset is None:
            raise ValueError("no stamp of this clock has been seen yet")
        return stamp + self.offset

    def take_worst_latency(self) -> float:
        """Return the largest latency since the last call [s]."""
        worst, self.worst_latency = self.worst_latency, 0.0
        return worst

    def _jumped(self, stamp: float, difference: float) -> bool:
        """Detect a jump and restart; return whether this message is ignored."""
        before, offset = self._last_stamp, self.offset
        if before is not None and offset is not None:
            if difference < offset - JUMP:
                self._restart(offset - difference)
            elif stamp < before - JUMP:
                self._backward_count += 1
                if self._backward_count < 2:
                    return True
                self._restart(offset - difference)
        self._backward_count = 0
        self._last_stamp = stamp if before is None else max(stamp, self._last_stamp or stamp)
        return False

    def _restart(self, jump: float) -> None:
        self.jumps += 1
        self.last_jump = jump
        self.offset = None
        self._smallest = _SlidingMinimum()
        self._round_trips.clear()
        self._last_stamp = self._last_answer = None

    def _slowed(self, offset: float, received: float) -> float:
        """Return an offset that rises no faster than clocks drift."""
        assert self.offset is not None
        return min(offset, self.offset + _FASTEST_DRIFT * max(received - self._offset_time, 0.0))

    def _count_latency(self, latency: float) -> None:
        latency = max(latency, 0.0)
        self.latency += _SMOOTHING * (latency - self.latency)
        self.worst_latency = max(self.worst_latency, latency)


class _SlidingMinimum:
    """The smallest value of the last _WINDOW seconds; each value is looked at twice at most."""

    def __init__(self) -> None:
        self._rising: deque[tuple[float, float]] = deque()

    def take(self, time: float, value: float) -> float:
        """Take a value at a time [s]; return the smallest one in the window."""
        while self._rising and self._rising[-1][1] >= value:
            self._rising.pop()
        self._rising.append((time, value))
        while self._rising[0][0] < time - _WINDOW:
            self._rising.popleft()
        return self._rising[0][1]

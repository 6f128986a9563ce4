"""Chambers of a hostile device: set-points held without a watchdog, first-order valves, and a log of every write."""

from __future__ import annotations

import bisect
import math
import threading
import time
from dataclasses import dataclass

FILL_TIME, VENT_TIME = 0.15, 0.10


@dataclass(frozen=True)
class Held:
    """A set-point that the valves worked to from a time on.

    Attributes:
        time: Monotonic time [s].
        goal: Set-points of both arms [mbar].
        pressure: Chamber pressures at this time [mbar].
    """

    time: float
    goal: tuple[float, float]
    pressure: tuple[float, float]

    def at(self, moment: float) -> tuple[float, float]:
        """Return the pressures at a later time [mbar]: a first-order lag."""
        duration = max(moment - self.time, 0.0)
        left, right = (_lag(p, g, duration) for p, g in zip(self.pressure, self.goal, strict=True))
        return (left, right)


class Chambers:
    """Two chambers with valves that keep the last set-point for ever.

    Attributes:
        requests: Every set-point that a bridge asked for: time [s], left, right [mbar].
        held: Every set-point that the valves worked to.
        start: Monotonic time from which the log counts [s].
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.start = time.monotonic()
        self.requests: list[tuple[float, float, float]] = []
        self.held = [Held(self.start, (0.0, 0.0), (0.0, 0.0))]

    def preset(self, left: float, right: float) -> None:
        """Hold a pressure from the start, as after a killed bridge."""
        self.held = [Held(self.start, (left, right), (left, right))]

    def ask(self, left: float, right: float, *, obey: bool = True) -> None:
        """Log a request; work to it unless the device disobeys."""
        self.requests.append((time.monotonic(), left, right))
        if obey:
            self.work_to(left, right)

    def work_to(self, left: float, right: float) -> None:
        """Work to a set-point [mbar]."""
        with self._lock:
            now = time.monotonic()
            if self.held[-1].goal != (left, right):
                self.held.append(Held(now, (left, right), self.held[-1].at(now)))

    def setpoint(self) -> tuple[float, float]:
        """Return the set-points that the valves work to [mbar]."""
        return self.held[-1].goal

    def pressure(self, moment: float | None = None) -> tuple[float, float]:
        """Return the pressures [mbar], now or at a moment of the past."""
        when = time.monotonic() if moment is None else moment
        index = bisect.bisect_right([held.time for held in self.held[-500:]], when)
        offset = max(len(self.held) - 500, 0)
        return self.held[max(offset + index - 1, 0)].at(when)

    def highest(self, since: float, until: float) -> float:
        """Return the largest pressure of a window [mbar]; between two changes a course is monotonic."""
        inside = [held.pressure for held in self.held if since <= held.time <= until]
        return max(max(pair) for pair in (self.pressure(since), *inside, self.pressure(until)))

    def empty_since(self, level: float, until: float) -> float | None:
        """Return the time from which both chambers stay below a level [mbar]; None while they do not."""
        if max(self.pressure(until)) > level:
            return None
        end = until
        for held in reversed(self.held):
            if max(held.pressure) > level:
                low, high = held.time, end
                while high - low > 1e-3:
                    middle = 0.5 * (low + high)
                    low, high = (middle, high) if max(held.at(middle)) > level else (low, middle)
                return high
            end = held.time
        return self.start

    def zero_asked_since(self) -> float | None:
        """Return the time of the request from which all are zero; None if the last one is not."""
        since = None
        for moment, *values in reversed(self.requests):
            if max(values) > 0.0:
                break
            since = moment
        return since

    def zero_held_since(self) -> float | None:
        """Return the time from which the valves work to zero; None if they do not."""
        since = None
        for held in reversed(self.held):
            if max(held.goal) > 0.0:
                break
            since = held.time
        return since


def _lag(present: float, goal: float, duration: float) -> float:
    time_constant = FILL_TIME if goal > present else VENT_TIME
    return goal + (present - goal) * math.exp(-duration / time_constant)

"""Event sources of a twin: each announces its next time and receives the state at that time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ldcs_ros.physics.state import State
from ldcs_ros.sensors import Ticks


class EventSource(Protocol):
    """A part of the twin that emits messages at times of its own."""

    @property
    def next_time(self) -> float:
        """Time of the next event [s], infinity for none."""

    def needs_state(self, time: float) -> bool:
        """Return whether the event at a time [s] needs the state of that very time."""

    def start(self, time: float) -> None:
        """Restart at a time [s]."""

    def report(self, time: float, state: State) -> None:
        """Emit the messages that are due at a time [s]."""


class PeriodicSource:
    """A source of one event per period, at exact multiples of the period.

    Args:
        rate: Events per second of simulation time [Hz].
        report: Called with the time [s] and the state of each event.
    """

    def __init__(self, rate: float, report: Callable[[float, State], None]) -> None:
        self._rate = rate
        self._report = report
        self.start(0.0)

    @property
    def next_time(self) -> float:
        """Time of the next event [s]."""
        return self._ticks.time

    @property
    def count(self) -> int:
        """Number of the latest event, as a multiple of the period."""
        return self._ticks.index - 1

    def needs_state(self, time: float) -> bool:
        """Return True: every event reports the state."""
        return True

    def start(self, time: float) -> None:
        """Restart at a time [s]: the first event is at or after it."""
        self._ticks = Ticks.starting_at(self._rate, time)

    def report(self, time: float, state: State) -> None:
        """Emit the event."""
        self._ticks.advance()
        self._report(time, state)


class ClockSource(PeriodicSource):
    """A periodic source that reports no state: the solver takes no step for it."""

    def needs_state(self, time: float) -> bool:
        """Return False."""
        return False

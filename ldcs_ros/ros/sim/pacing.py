"""Pacing of simulation time against a steady clock by absolute deadlines, and a meter of the achieved pace."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

AS_FAST_AS_POSSIBLE = -1.0
_LONGEST_SLEEP = 0.05
_LEAST_TOLERANCE = 0.02


def tolerance(publish_rate: float, real_time_factor: float) -> float:
    """Return the lateness that is not yet an overrun [s]: a publish period of wall time, and at least 20 ms.

    A solver that takes few long steps is late by the time of one of them, and early again with the reports that it
    has then computed in advance: at a high rate that is no loss of pace.
    """
    return max(1.0 / (publish_rate * abs(real_time_factor)), _LEAST_TOLERANCE)


class Pacer:
    """A pacer of the events of the simulation.

    Deadlines count from a reference time, so that errors do not add up. An event later than the tolerance is an
    overrun: it is counted, and the reference time moves, so that no burst makes up for lost time.

    Args:
        real_time_factor: Simulated seconds per second; AS_FAST_AS_POSSIBLE for no waiting.
        tolerance: Lateness that is not yet an overrun [s].
        clock: Steady clock [s].

    Attributes:
        overruns: Events that came later than the tolerance.
        worst_lateness: Largest lateness since it was last read by `take_worst_lateness` [s].
    """

    def __init__(
        self, real_time_factor: float, *, tolerance: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.real_time_factor = real_time_factor
        self.tolerance = tolerance
        self.overruns = 0
        self.worst_lateness = 0.0
        self._clock = clock
        self._reference_time: tuple[float, float] | None = None

    def reset(self) -> None:
        """Forget the reference time: the next event is due at once and sets it."""
        self._reference_time = None

    def wait(self, simulation_time: float, wake: threading.Event) -> bool:
        """Wait for the deadline of a simulation time [s], or a part of that time, or until `wake` is set.

        Returns:
            Whether the deadline has come.
        """
        if self.real_time_factor <= 0.0:
            return True
        now = self._clock()
        if self._reference_time is None:
            self._reference_time = (now, simulation_time)
            return True
        wall, simulated = self._reference_time
        lateness = now - wall - (simulation_time - simulated) / self.real_time_factor
        if lateness < 0.0:
            wake.wait(min(-lateness, _LONGEST_SLEEP))
            return False
        self.worst_lateness = max(self.worst_lateness, lateness)
        if lateness > self.tolerance:
            self.overruns += 1
            self._reference_time = (now, simulation_time)
        return True

    def take_worst_lateness(self) -> float:
        """Return the largest lateness since the last call [s]."""
        worst, self.worst_lateness = self.worst_lateness, 0.0
        return worst


class PaceMeter:
    """Measures progress between two readings.

    Attributes:
        real_time_factor: Simulated seconds per second between the last two readings.
        step_time: Mean wall time of an advance between them [s].
        worst_step_time: Longest one [s].
    """

    def __init__(self) -> None:
        self.real_time_factor = 0.0
        self.step_time = 0.0
        self.worst_step_time = 0.0
        self.restart(0.0)

    def restart(self, simulation_time: float) -> None:
        """Measure from this simulation time [s] on, as after a reset or a pause."""
        self._since = (time.perf_counter(), simulation_time)
        self._busy, self._worst, self._count = 0.0, 0.0, 0

    def count(self, duration: float) -> None:
        """Count an advance that took a wall time [s]."""
        self._busy += duration
        self._worst = max(self._worst, duration)
        self._count += 1

    def read(self, simulation_time: float) -> None:
        """Update the figures to this simulation time [s] and start the next period."""
        wall, simulated = self._since
        elapsed = time.perf_counter() - wall
        self.real_time_factor = (simulation_time - simulated) / elapsed if elapsed > 0.0 else 0.0
        self.step_time = self._busy / self._count if self._count else 0.0
        self.worst_step_time = self._worst
        self.restart(simulation_time)

"""What the simulation achieves: real-time factor and cost of a step over the last period."""

from __future__ import annotations

import time
from collections.abc import Callable


class PaceMeter:
    """Measures progress between two readings.

    Args:
        clock: Steady clock [s].

    Attributes:
        real_time_factor: Simulated seconds a second between the last two readings.
        step_time: Mean wall time of an advance between them [s].
        worst_step_time: Longest one [s].
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self.real_time_factor = 0.0
        self.step_time = 0.0
        self.worst_step_time = 0.0
        self.restart(0.0)

    def restart(self, simulation_time: float) -> None:
        """Measure from this simulation time [s] on, as after a reset or a pause."""
        self._since = (self._clock(), simulation_time)
        self._busy, self._worst, self._count = 0.0, 0.0, 0

    def count(self, duration: float) -> None:
        """Count an advance that took a wall time [s]."""
        self._busy += duration
        self._worst = max(self._worst, duration)
        self._count += 1

    def read(self, simulation_time: float) -> None:
        """Bring the figures up to this simulation time [s] and start the next period."""
        wall, simulated = self._since
        elapsed = self._clock() - wall
        self.real_time_factor = (simulation_time - simulated) / elapsed if elapsed > 0.0 else 0.0
        self.step_time = self._busy / self._count if self._count else 0.0
        self.worst_step_time = self._worst
        self.restart(simulation_time)

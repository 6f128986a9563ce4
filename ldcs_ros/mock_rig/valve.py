"""A pneumatic valve with its chamber: dead time, dead band, rate limit, separate fill and vent, stuck, leak."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True)
class ValveParameters:
    """A proportional valve on one arm.

    Attributes:
        fill_time: Time constant of rising pressure [s].
        vent_time: Time constant of falling pressure [s].
        dead_time: Delay of its answer [s].
        dead_band: Largest change of the set-point that it ignores [Pa].
        rate_limit: Largest rate of pressure [Pa/s].
        leak_time: Time constant with which a leaking chamber empties [s].
    """

    fill_time: float = 0.15
    vent_time: float = 0.10
    dead_time: float = 0.02
    dead_band: float = 200.0
    rate_limit: float = 2.0e6
    leak_time: float = 0.25


class ProportionalValve:
    """Integrates the pressure of one chamber.

    Args:
        parameters: The valve.

    Attributes:
        pressure: Gauge pressure in the chamber [Pa].
    """

    def __init__(self, parameters: ValveParameters) -> None:
        self.parameters = parameters
        self.pressure = 0.0
        self._goal = 0.0
        self._coming: deque[tuple[float, float]] = deque()

    def advance(self, time: float, duration: float, setpoint: float, *, stuck: bool, leak: bool) -> None:
        """Go on by a duration [s] to a time [s] under a set-point [Pa]."""
        p = self.parameters
        self._coming.append((time + p.dead_time, setpoint))
        while self._coming and self._coming[0][0] <= time:
            arrived = self._coming.popleft()[1]
            if abs(arrived - self._goal) > p.dead_band or arrived == 0.0:
                self._goal = arrived
        if stuck:
            return
        tau = p.fill_time if self._goal > self.pressure else p.vent_time
        # Exact for a constant goal, so that the result does not depend on the step.
        change = (self._goal - self.pressure) * -math.expm1(-duration / tau)
        change = min(max(change, -p.rate_limit * duration), p.rate_limit * duration)
        if leak:
            change += self.pressure * math.expm1(-duration / p.leak_time)
        self.pressure = max(0.0, self.pressure + change)

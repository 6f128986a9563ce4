"""A pneumatic valve with its chamber: dead time, dead band, rate limit, separate fill and vent, stuck, leak."""

from __future__ import annotations

import math
from collections import deque

FILL_TIME, VENT_TIME, LEAK_TIME = 0.15, 0.10, 0.25
"""Time constants of rising and of falling pressure, and of a leaking chamber [s]."""
DEAD_TIME = 0.02
"""Delay of an answer [s]."""
DEAD_BAND = 200.0
"""Largest change of the set-point without an answer [Pa]."""
RATE_LIMIT = 2.0e6
"""Largest rate of pressure [Pa/s]."""


class ProportionalValve:
    """A proportional valve on one arm, with the pressure of its chamber.

    Attributes:
        pressure: Gauge pressure in the chamber [Pa].
    """

    def __init__(self) -> None:
        self.pressure = 0.0
        self._goal = 0.0
        self._coming: deque[tuple[float, float]] = deque()

    def advance(self, time: float, duration: float, setpoint: float, *, stuck: bool, leak: bool) -> None:
        """Go on by a duration [s] to a time [s] under a set-point [Pa]."""
        self._coming.append((time + DEAD_TIME, setpoint))
        while self._coming and self._coming[0][0] <= time:
            arrived = self._coming.popleft()[1]
            if abs(arrived - self._goal) > DEAD_BAND or arrived == 0.0:
                self._goal = arrived
        if stuck:
            return
        tau = FILL_TIME if self._goal > self.pressure else VENT_TIME
        # Exact for a constant goal, so that the result does not depend on the step.
        change = (self._goal - self.pressure) * -math.expm1(-duration / tau)
        change = min(max(change, -RATE_LIMIT * duration), RATE_LIMIT * duration)
        if leak:
            change += self.pressure * math.expm1(-duration / LEAK_TIME)
        self.pressure = max(0.0, self.pressure + change)

"""A sampling grid that cannot drift: tick k lies at k / rate, independent of all before."""

from __future__ import annotations

import math
from dataclasses import dataclass

# A start this close before a tick [ticks] counts as being on it: division rounds by far less.
_ON_TICK = 1e-9


@dataclass
class Ticks:
    """The next tick of a grid.

    >>> Ticks.starting_at(80.0, 1.0).time
    1.0

    Attributes:
        rate: Ticks per second [Hz], above 0.
        index: Number of the next tick.
    """

    rate: float
    index: int = 0

    @classmethod
    def starting_at(cls, rate: float, time: float) -> Ticks:
        """Return the grid with the first tick at or after `time` [s] as the next one."""
        return cls(rate, math.ceil(time * rate - _ON_TICK))

    @property
    def time(self) -> float:
        """Time of the next tick [s]: one rounded division, so grids of different rates meet exactly."""
        return self.index / self.rate

    def advance(self) -> None:
        """Go on to the following tick."""
        self.index += 1

"""Venting the arms: what was commanded goes to zero along a ramp, so that the sheet is not dropped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RAMP_TIME = 0.5
"""Duration of the ramp [s] of simulation time."""


@dataclass(frozen=True)
class VentRamp:
    """A straight ramp to zero.

    Attributes:
        start: When it begins [s].
        value: What was commanded then, gauge pressures [Pa] or torques [N m], any shape.
        duration: How long it takes [s].
    """

    start: float
    value: np.ndarray
    duration: float = RAMP_TIME

    def at(self, time: float) -> np.ndarray:
        """Return what to command at `time` [s], the shape of `value`."""
        share = (time - self.start) / self.duration if self.duration > 0.0 else 1.0
        return self.value * max(0.0, 1.0 - share)

    def is_over(self, time: float) -> bool:
        """Tell whether zero has been reached at `time` [s]."""
        return time - self.start >= self.duration

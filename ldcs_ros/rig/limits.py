"""Limits: bounds, slew and times that no command may exceed, for the gate and for the output stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ldcs_ros.errors import BridgeError

LONGEST_STEP = 0.1
"""Time that one step of slew may span [s]: after a stall a set-point must not jump."""
BOUNDS = {
    "pressure": (1.0, 1e7),
    "slew": (1.0, 1e9),
    "vent_ramp": (0.01, 60.0),
    "vent_time": (0.01, 600.0),
    "command_timeout": (0.01, 60.0),
    "rig_timeout": (0.01, 60.0),
    "arm_timeout": (0.1, 600.0),
}

Pressures = tuple[float, ...]
"""Gauge pressures [Pa], one for each arm."""


@dataclass(frozen=True)
class Limits:
    """The limits of one rig.

    Attributes:
        pressure: Largest gauge pressure [Pa]; the smallest is 0, since negative set-points upset valve islands.
        slew: Largest rate of a commanded change [Pa/s].
        vent_ramp: Time in which a vent takes the set-point from `pressure` to zero [s].
        vent_time: By when the chambers are empty after a vent begins [s]: the ramp and the valves' own time.
        command_timeout: Silence of the operator after which the arms are vented [s of steady clock].
        rig_timeout: The same for silence of the rig, and for writes that are not confirmed [s of steady clock].
        arm_timeout: Time after arming within which the first command must come [s of steady clock].
    """

    pressure: float = 140e3
    slew: float = 400e3
    vent_ramp: float = 0.3
    vent_time: float = 1.0
    command_timeout: float = 0.4
    rig_timeout: float = 0.4
    arm_timeout: float = 5.0

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if not isinstance(value, (int, float)) or isinstance(value, bool) or not low <= value <= high:
                raise BridgeError(f"got {value!r}, expected a number {low:g} ... {high:g} @ limits.{name}")
        if self.vent_time < self.vent_ramp:
            raise BridgeError(
                f"got {self.vent_time:g} s, expected at least vent_ramp ({self.vent_ramp:g} s) @ limits.vent_time"
            )

    @property
    def vent_rate(self) -> float:
        """Rate of the ramp of a vent [Pa/s]."""
        return self.pressure / self.vent_ramp

    def bounded(self, pressure: Sequence[float]) -> Pressures:
        """Return pressures [Pa] within 0 and the largest one; 0 for what is not a number."""
        # Python's max returns its first argument when the second one is not a number.
        return tuple(min(max(0.0, value), self.pressure) for value in pressure)

    def step(self, present: Sequence[float], target: Sequence[float], duration: float) -> Pressures:
        """Return set-points [Pa] that go from the present ones towards the target ones within bounds and slew.

        Args:
            present: Set-points now [Pa], shape (n_arms,).
            target: Set-points asked for [Pa], shape (n_arms,).
            duration: Time since the present ones were set [s].
        """
        reach = self.slew * min(max(duration, 0.0), LONGEST_STEP)
        return tuple(
            min(max(goal, now - reach), now + reach)
            for now, goal in zip(present, self.bounded(target), strict=True)
        )

    def vent(self, present: Sequence[float], duration: float) -> Pressures:
        """Return set-points [Pa] further down the ramp of a vent; the ramp makes up for a stall."""
        fall = self.vent_rate * max(duration, 0.0)
        return self.bounded([value - fall for value in present])

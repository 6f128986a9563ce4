"""Limits: bounds, slew and times that no command may exceed, for the gate and for the output stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ldcs_ros.errors import BridgeError
from ldcs_ros.schema.units import ARM_NAMES, MAX_ARMS

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
PER_ARM = ("pressure", "slew")
"""Limits that each arm may have of its own."""

Pressures = tuple[float, ...]
"""Gauge pressures [Pa], one for each arm."""
PerArm = float | Mapping[str, float]
"""One number for all arms, or each arm's own by name."""


@dataclass(frozen=True)
class Limits:
    """The limits of one rig.

    Attributes:
        arms: Names of the arms, in the order of their set-points.
        pressure: Largest gauge pressure [Pa]; the smallest is 0, since negative set-points upset valve islands.
        slew: Largest rate of a commanded change [Pa/s].
        vent_ramp: Time in which a vent takes the set-point from `pressure` to zero [s].
        vent_time: By when the chambers are empty after a vent begins [s]: the ramp and the valves' own time.
        command_timeout: Silence of the operator after which the arms are vented [s of steady clock].
        rig_timeout: The same for silence of the rig, and for writes that are not confirmed [s of steady clock].
        arm_timeout: Time after arming within which the first command must come [s of steady clock].
    """

    arms: tuple[str, ...] = ARM_NAMES
    pressure: PerArm = 140e3
    slew: PerArm = 400e3
    vent_ramp: float = 0.3
    vent_time: float = 1.0
    command_timeout: float = 0.4
    rig_timeout: float = 0.4
    arm_timeout: float = 5.0

    def __post_init__(self) -> None:
        _check_names(self.arms)
        for name in BOUNDS:
            value = getattr(self, name)
            if name not in PER_ARM or not isinstance(value, Mapping):
                _check_number(value, name, f"limits.{name}")
                continue
            if set(value) != set(self.arms):
                raise BridgeError(
                    f"got {list(value)}, expected one number for all arms or one for each of {list(self.arms)} "
                    f"@ limits.{name}"
                )
            for arm, number in value.items():
                _check_number(number, name, f"limits.{name}.{arm}")
        if self.vent_time < self.vent_ramp:
            raise BridgeError(
                f"got {self.vent_time:g} s, expected at least vent_ramp ({self.vent_ramp:g} s) @ limits.vent_time"
            )

    @property
    def highest(self) -> Pressures:
        """Largest gauge pressure of each arm [Pa]."""
        return self._of_each(self.pressure)

    @property
    def slew_rates(self) -> tuple[float, ...]:
        """Largest rate of a commanded change of each arm [Pa/s]."""
        return self._of_each(self.slew)

    @property
    def vent_rates(self) -> tuple[float, ...]:
        """Rate of the ramp of a vent of each arm [Pa/s]: each is at zero after `vent_ramp`."""
        return tuple(pressure / self.vent_ramp for pressure in self.highest)

    def of(self, arm: str) -> float:
        """Return the largest gauge pressure of an arm [Pa]."""
        return self.pressure[arm] if isinstance(self.pressure, Mapping) else self.pressure

    def shown(self) -> str:
        """Return the largest pressures [Pa] for a message: one number, or each arm's own."""
        if not isinstance(self.pressure, Mapping):
            return f"{self.pressure:g}"
        return ", ".join(f"{value:g} ({arm})" for arm, value in zip(self.arms, self.highest, strict=True))

    def bounded(self, pressure: Sequence[float]) -> Pressures:
        """Return pressures [Pa], shape (n_arms,), within 0 and the largest one; 0 for what is not a number."""
        # Python's max returns its first argument when the second one is not a number.
        return tuple(min(max(0.0, value), most) for value, most in zip(pressure, self.highest, strict=True))

    def step(self, present: Sequence[float], target: Sequence[float], duration: float) -> Pressures:
        """Return set-points [Pa] that go from the present ones towards the target ones within bounds and slew.

        Args:
            present: Set-points now [Pa], shape (n_arms,).
            target: Set-points asked for [Pa], shape (n_arms,).
            duration: Time since the present ones were set [s].
        """
        span = min(max(duration, 0.0), LONGEST_STEP)
        return tuple(
            min(max(goal, now - rate * span), now + rate * span)
            for now, goal, rate in zip(present, self.bounded(target), self.slew_rates, strict=True)
        )

    def vent(self, present: Sequence[float], duration: float) -> Pressures:
        """Return set-points [Pa] further down the ramp of a vent; the ramp makes up for a stall."""
        falls = [rate * max(duration, 0.0) for rate in self.vent_rates]
        return self.bounded([value - fall for value, fall in zip(present, falls, strict=True)])

    def _of_each(self, limit: PerArm) -> tuple[float, ...]:
        if isinstance(limit, Mapping):
            return tuple(limit[arm] for arm in self.arms)
        return (limit,) * len(self.arms)


def _check_names(arms: tuple[str, ...]) -> None:
    if not 1 <= len(arms) <= MAX_ARMS:
        raise BridgeError(f"got {len(arms)} arms, expected 1 ... {MAX_ARMS} @ arms")
    for index, name in enumerate(arms):
        if not name.isidentifier():
            raise BridgeError(f"got {name!r}, expected letters, digits and underscores @ arms[{index}]")
        if name in arms[:index]:
            raise BridgeError(f"the name {name!r} occurs twice; name each arm once @ arms[{index}]")


def _check_number(value: object, name: str, path: str) -> None:
    low, high = BOUNDS[name]
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not low <= value <= high:
        raise BridgeError(f"got {value!r}, expected a number {low:g} ... {high:g} @ {path}")

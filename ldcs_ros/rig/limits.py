"""Hard limits of pressure: bounds and slew, kept twice, by the gate and by each transport on its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import BridgeError

_LONGEST_STEP = 0.1
"""Time that one step of slew may span [s]: after a stall a set-point must not jump."""


@dataclass(frozen=True)
class Limits:
    """What no command may exceed.

    Attributes:
        pressure: Largest gauge pressure [Pa]; the smallest is 0, since negative set-points upset valve islands.
        slew: Largest rate of a commanded change [Pa/s].
        vent_ramp: Time in which a vent takes the set-point from `pressure` to zero [s].
        vent_time: By when the chambers are empty after a vent begins [s]: the ramp and the valves' own time.
        command_timeout: Silence of the operator after which the arms are vented [s of steady clock].
        rig_timeout: The same for silence of the rig [s of steady clock].
    """

    pressure: float = 140e3
    slew: float = 400e3
    vent_ramp: float = 0.3
    vent_time: float = 1.0
    command_timeout: float = 0.4
    rig_timeout: float = 0.4

    def __post_init__(self) -> None:
        bounds = {
            "pressure": (1.0, 1e7),
            "slew": (1.0, 1e9),
            "vent_ramp": (0.01, 60.0),
            "vent_time": (0.01, 600.0),
            "command_timeout": (0.01, 60.0),
            "rig_timeout": (0.01, 60.0),
        }
        for name, (low, high) in bounds.items():
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

    def step(self, present: np.ndarray, target: np.ndarray, duration: float) -> np.ndarray:
        """Return set-points [Pa] that go from the present ones towards the target ones within bounds and slew.

        Args:
            present: Set-points now [Pa], shape (n_arms,).
            target: Where they should go [Pa], shape (n_arms,).
            duration: Time since the present ones were set [s].
        """
        reach = self.slew * min(max(duration, 0.0), _LONGEST_STEP)
        bounded = np.clip(target, 0.0, self.pressure)
        return np.array(np.clip(bounded, present - reach, present + reach))

    def vent(self, present: np.ndarray, duration: float) -> np.ndarray:
        """Return set-points [Pa] further down the ramp of a vent; the ramp makes up for a stall."""
        return np.clip(present - self.vent_rate * max(duration, 0.0), 0.0, self.pressure)


class LastStage:
    """The second place of every limit, just before a set-point leaves: trusts nothing that the gate did.

    The gate offers set-points; what is sent is bounded, changes no faster than the slew (or a vent's ramp on
    the way down), and ramps to zero when the gate has been silent for the command timeout.

    Args:
        limits: What holds.
        clock: Steady clock [s].
        n_arms: Number of arms.

    Attributes:
        corrections: Set-points that the gate let pass and this stage did not.
        starved: The gate has fallen silent; set-points ramp to zero.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float], n_arms: int = 2) -> None:
        self._limits, self._clock = limits, clock
        self._sent = np.zeros(n_arms)
        self._offered: np.ndarray | None = None
        self._offered_at = self._sent_at = clock()
        self.corrections = 0
        self.starved = False

    def offer(self, pressure: np.ndarray | None) -> None:
        """Take set-points [Pa] from the gate, shape (n_arms,); None to send nothing at all."""
        self._offered, self._offered_at = pressure, self._clock()

    def next(self) -> np.ndarray | None:
        """Return the set-points to send now [Pa], shape (n_arms,), or None to send nothing."""
        now, offered = self._clock(), self._offered
        duration, self._sent_at = now - self._sent_at, now
        if offered is None:
            self.starved = False
            self._sent = np.zeros_like(self._sent)
            return None
        self.starved = now - self._offered_at > self._limits.command_timeout
        sound = offered.shape == self._sent.shape and bool(np.isfinite(offered).all())
        if self.starved or not sound:
            self._sent = self._limits.vent(self._sent, duration)
        else:
            bounded = np.clip(offered, 0.0, self._limits.pressure)
            # A gate and a transport tick at times of their own: half a period more than the gate's reach.
            reach = 1.5 * self._limits.slew * min(max(duration, 0.0), _LONGEST_STEP)
            fall = max(reach, 1.5 * self._limits.vent_rate * max(duration, 0.0))
            self._sent = np.clip(bounded, self._sent - fall, self._sent + reach)
            astray = np.abs(self._sent - bounded) > self._limits.slew * _LONGEST_STEP
            sound = bool((bounded == offered).all() and not astray.any())
        if not sound:
            self.corrections += 1
        return np.array(self._sent)

"""The second place of every limit, just before a set-point leaves; it does not rely on the gate."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence

from ldcs_ros.rig.limits import LONGEST_STEP, Limits, Pressures


class OutputState(enum.Enum):
    """The state of an output stage."""

    IDLE = "idle"
    ACTIVE = "active"
    VENTED = "vented"


class OutputLimiter:
    """A bound on what is sent, with a latched vent of its own.

    Idle, it sends nothing. A fresh set-point of a new epoch, one for each arming of the gate, makes it active.
    A vent latches the epoch: set-points of that epoch and of earlier ones move nothing any more. It vents by
    itself when the latest set-point is older than the command timeout, and when it was itself not asked for
    that long, because its process was stopped or starved.

    Args:
        limits: Limits that hold.
        clock: Steady clock [s], the one of the gate.

    Attributes:
        state: Present state.
        reason: Reason of the vent, in words; '' for none.
        sent: Set-points that were sent last, gauge [Pa].
        epoch: Epoch of the set-points it follows, or of the latest vent.
        clipped_count: Set-points that the gate let pass and this stage did not.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float]) -> None:
        self._limits, self._clock = limits, clock
        self.state = OutputState.IDLE
        self.reason = ""
        self.sent: Pressures = (0.0,) * len(limits.arms)
        self.epoch = 0
        self.clipped_count = 0
        self._target: Sequence[float] = self.sent
        self._target_time = self._asked_at = clock()

    def set_target(self, pressure: Sequence[float], epoch: int, time: float) -> None:
        """Take set-points of the gate.

        Args:
            pressure: Gauge pressures [Pa], one for each arm.
            epoch: The arming they belong to.
            time: Steady time at which the gate made them [s].
        """
        now = self._clock()
        time = min(time, now)
        fresh = now - time <= self._limits.command_timeout
        if self.state is OutputState.ACTIVE:
            if epoch == self.epoch and time >= self._target_time:
                self._target, self._target_time = pressure, time
            return
        if epoch > self.epoch and fresh:
            self.state, self.reason, self.epoch = OutputState.ACTIVE, "", epoch
            self.sent = (0.0,) * len(self.sent)
            self._target, self._target_time, self._asked_at = pressure, time, now

    def vent(self, reason: str, *, start: Sequence[float] | None = None, epoch: int | None = None) -> None:
        """Ramp to zero and stay there until a new epoch begins.

        Args:
            reason: Cause in words; the first one is kept.
            start: Set-points that the device works to [Pa], where the ramp begins if nothing was sent so far.
            epoch: Latest epoch of the gate, where it is newer than the one followed here.
        """
        self.epoch = max(self.epoch, epoch or 0)
        if self.state is OutputState.VENTED:
            return
        if self.state is OutputState.IDLE and start is not None:
            self.sent = self._limits.bounded(start)
        self.state, self.reason = OutputState.VENTED, reason
        self._asked_at = self._clock()

    def next(self) -> Pressures | None:
        """Return the set-points to send now, gauge [Pa], or None to send nothing."""
        now = self._clock()
        duration, self._asked_at = now - self._asked_at, now
        if self.state is OutputState.IDLE:
            return None
        timeout, silence = self._limits.command_timeout, now - self._target_time
        if self.state is OutputState.ACTIVE:
            if duration > timeout:
                self.vent(f"the output process was stopped or starved for {duration:.2f} s")
            elif silence > timeout:
                self.vent(f"the bridge is silent for {silence:.2f} s")
        if self.state is OutputState.VENTED:
            self.sent = self._limits.vent(self.sent, duration)
        else:
            self._follow(duration)
        return self.sent

    def _follow(self, duration: float) -> None:
        target, limits = self._target, self._limits
        if len(target) != len(self.sent) or not all(map(math.isfinite, target)):
            self.clipped_count += 1
            self.sent = limits.vent(self.sent, duration)
            return
        bounded = limits.bounded(target)
        # Gate and output stage tick at times of their own: half a period more than the gate's reach.
        span = 1.5 * min(max(duration, 0.0), LONGEST_STEP)
        self.sent = tuple(
            min(max(goal, now - rate * span), now + rate * span)
            for now, goal, rate in zip(self.sent, bounded, limits.slew_rates, strict=True)
        )
        astray = any(
            abs(now - goal) > rate * LONGEST_STEP
            for now, goal, rate in zip(self.sent, bounded, limits.slew_rates, strict=True)
        )
        self.clipped_count += astray or bounded != tuple(target)

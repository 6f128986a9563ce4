"""The gate that every command passes on its way to a rig: mode, arming, limits, slew, watchdog, latched vent."""

from __future__ import annotations

import enum
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.limits import Limits, Pressures


class Mode(enum.Enum):
    """The mode of a bridge."""

    SHADOW = "shadow"
    MIRROR = "mirror"
    LIVE = "live"


class GateState(enum.Enum):
    """The state of a gate."""

    CLOSED = "closed"
    DISARMED = "disarmed"
    ARMED = "armed"
    VENTED = "vented"


class Gate:
    """A filter from an operator's commands to set-points for a rig; the first place of every limit.

    Only mode `live` opens it, and only `arm` makes it pass commands on. Every fault ramps the set-points to
    zero along the vent's ramp and latches: zero is sent and commands are refused until the next arming.
    Before the first arming it sends nothing, unless `disarm` asks for a vent.

    The time of a command is the time when it was heard. A gate that was not ticked for the command timeout
    has itself been stopped or starved: it vents, whatever came meanwhile.

    Args:
        mode: Mode of the bridge.
        limits: Limits that hold.
        clock: Steady clock [s].

    Attributes:
        state: Present state.
        epoch: Number of armings; the output stage follows set-points of the latest one only.
        reason: Reason of the vent, in words; '' for none.
        trips: Number of vents by itself.
        accepted: Number of accepted commands.
        refused: Number of refused commands by reason.
        last_refusal: The latest refusal in words; '' while there was none.
    """

    def __init__(self, mode: Mode, limits: Limits, clock: Callable[[], float]) -> None:
        self.mode, self.limits = mode, limits
        self._clock = clock
        self.state = GateState.DISARMED if mode is Mode.LIVE else GateState.CLOSED
        self.epoch = 0
        self.reason = ""
        self.trips = 0
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.last_refusal = ""
        self._zero: Pressures = (0.0,) * len(limits.arms)
        self._target = self._setpoint = self._zero
        self._ticked_at = self._armed_at = clock()
        self._commanded_at: float | None = None
        self._vented_at: float | None = None

    @property
    def setpoint(self) -> Pressures:
        """Present set-points, gauge [Pa], one for each arm."""
        return self._setpoint

    @property
    def venting_for(self) -> float | None:
        """Time since the last vent began [s]; None while armed or before the first one."""
        return None if self._vented_at is None else self._clock() - self._vented_at

    def command(self, pressure: Iterable[float], heard: float | None = None) -> None:
        """Take a command: gauge pressures [Pa], one for all arms or one for each.

        Args:
            pressure: Pressures asked for.
            heard: Steady time at which the command was heard [s]; None for now.

        Raises:
            BridgeError: The command is refused whole and counted; nothing changed.
        """
        now = self._clock()
        heard = now if heard is None else min(heard, now)
        self._check_ticks(now)
        n, given = len(self._target), [float(value) for value in pressure]
        if self.state is GateState.CLOSED:
            self._refuse("mode", f"mode {self.mode.value} commands nothing; start the bridge with mode live")
        if self.state is GateState.DISARMED:
            self._refuse("not armed", "call arm first")
        if self.state is GateState.VENTED:
            self._refuse(
                "vented", f"the arms were vented ({self.reason}); call arm, then send commands in time"
            )
        if heard < self._armed_at:
            self._refuse("too old", "the command was heard before the arming; send it again")
        if now - heard > self.limits.command_timeout:
            self._refuse(
                "too old", f"got {now - heard:.2f} s, expected at most {self.limits.command_timeout:g} s"
            )
        if len(given) not in (1, n):
            self._refuse("wrong size", f"got {len(given)} pressures, expected 1 or {n} [Pa]")
        if not all(map(math.isfinite, given)):
            self._refuse("not a number", f"got {given}, expected finite pressures [Pa]")
        target = tuple(given if len(given) == n else given * n)
        if self.limits.bounded(target) != target:
            self._refuse("over limit", f"got {given} Pa, expected 0 ... {self.limits.shown()} Pa (gauge)")
        self._target = target
        self._commanded_at = heard
        self.accepted += 1

    def arm(self, preconditions: Sequence[str] = ()) -> None:
        """Pass commands on from now.

        Args:
            preconditions: Preconditions that do not hold, in words.

        Raises:
            BridgeError: A precondition does not hold; nothing changed.
        """
        if self.mode is not Mode.LIVE:
            raise BridgeError(f"mode {self.mode.value} commands nothing; start the bridge with mode live")
        if self.state is GateState.ARMED:
            raise BridgeError("it is armed already")
        if preconditions:
            raise BridgeError(f"not armed: {'; '.join(preconditions)}")
        self.state, self.reason = GateState.ARMED, ""
        self.epoch += 1
        self._target = self._setpoint = self._zero
        self._armed_at = self._ticked_at = self._clock()
        self._commanded_at = self._vented_at = None

    def disarm(self, reason: str = "disarmed by the operator") -> bool:
        """Vent and refuse commands until armed again, in mode live from every state; return whether it was armed."""
        armed = self.state is GateState.ARMED
        if armed or self.state is GateState.DISARMED:
            self.state, self.reason = GateState.VENTED, reason
            self._target = self._zero
            self._vented_at = self._clock()
        return armed

    def trip(self, reason: str) -> bool:
        """Vent on a fault while armed; return whether it was armed."""
        armed = self.state is GateState.ARMED and self.disarm(reason)
        self.trips += armed
        return armed

    def tick(self) -> Pressures | None:
        """Go on to the present; return the set-points to send, gauge [Pa], or None for nothing."""
        now = self._clock()
        self._check_ticks(now)
        duration, self._ticked_at = now - self._ticked_at, now
        if self.state in (GateState.CLOSED, GateState.DISARMED):
            return None
        if self.state is GateState.ARMED:
            self._check_silence(now)
        if self.state is GateState.ARMED:
            self._setpoint = self.limits.step(self._setpoint, self._target, duration)
        else:
            self._setpoint = self.limits.vent(self._setpoint, duration)
        return self._setpoint

    def count_refusal(self, reason: str, detail: str) -> None:
        """Count a refusal; also of bytes that are no command at all."""
        self.refused[reason] += 1
        self.last_refusal = f"{reason}: {detail}"

    def _check_ticks(self, now: float) -> None:
        late = now - self._ticked_at
        if self.state is GateState.ARMED and late > self.limits.command_timeout:
            self.trip(f"the bridge was stopped or starved for {late:.2f} s")

    def _check_silence(self, now: float) -> None:
        timeout, first = self.limits.command_timeout, self.limits.arm_timeout
        if self._commanded_at is not None:
            if now - self._commanded_at > timeout:
                self.trip(f"no command for {timeout:g} s")
        elif now - self._armed_at > first:
            self.trip(f"no command within {first:g} s after arming")

    def _refuse(self, reason: str, detail: str) -> None:
        self.count_refusal(reason, detail)
        raise BridgeError(self.last_refusal)

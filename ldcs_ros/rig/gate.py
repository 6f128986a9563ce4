"""The gate that every command passes on its way to a rig: mode, arming, limits, slew, watchdog, latched vent."""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.limits import Limits


class Mode(enum.Enum):
    """What the bridge may do."""

    SHADOW = "shadow"
    MIRROR = "mirror"
    LIVE = "live"


class GateState(enum.Enum):
    """What the gate does with commands."""

    CLOSED = "closed"
    DISARMED = "disarmed"
    ARMED = "armed"
    VENTED = "vented"


class Gate:
    """Turns what an operator asks for into set-points that a rig may get; the first place of every limit.

    Only mode `live` opens it, and only `arm` makes it pass commands on. Whatever then goes wrong ramps the
    set-points to zero along the vent's ramp and latches: zero is sent, commands are refused, until somebody
    arms it again. Before it was ever armed it sends nothing.

    Args:
        mode: What the bridge may do.
        limits: What holds.
        clock: Steady clock [s].
        n_arms: Number of arms.

    Attributes:
        state: What it does with commands.
        reason: Why it vented, in words; '' while it has not.
        trips: How often it vented by itself.
        accepted: Number of accepted commands.
        refused: Number of refused commands by reason.
        last_refusal: The latest refusal in words; '' while there was none.
    """

    def __init__(self, mode: Mode, limits: Limits, clock: Callable[[], float], n_arms: int = 2) -> None:
        self.mode, self.limits = mode, limits
        self._clock = clock
        self.state = GateState.DISARMED if mode is Mode.LIVE else GateState.CLOSED
        self.reason = ""
        self.trips = 0
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.last_refusal = ""
        self._target = np.zeros(n_arms)
        self._setpoint = np.zeros(n_arms)
        self._ticked_at = clock()
        self._commanded_at: float | None = None
        self._vented_at: float | None = None

    @property
    def setpoint(self) -> np.ndarray:
        """Present set-points, gauge [Pa], shape (n_arms,)."""
        return np.array(self._setpoint)

    @property
    def venting_for(self) -> float | None:
        """How long ago the last vent began [s]; None while armed or before the first one."""
        return None if self._vented_at is None else self._clock() - self._vented_at

    def command(self, pressure: Sequence[float] | np.ndarray) -> None:
        """Take a command: gauge pressures [Pa], one for all arms or one for each.

        Raises:
            BridgeError: Refused whole, counted; nothing changed.
        """
        values = np.asarray(pressure, dtype=float).ravel()
        n, highest = len(self._target), self.limits.pressure
        if self.state is GateState.CLOSED:
            self._refuse("mode", f"mode {self.mode.value} commands nothing; start the bridge with mode live")
        if self.state is GateState.DISARMED:
            self._refuse("not armed", "call arm first")
        if self.state is GateState.VENTED:
            self._refuse(
                "vented", f"the arms were vented ({self.reason}); call arm, then send commands in time"
            )
        if values.size not in (1, n):
            self._refuse("wrong size", f"got {values.size} pressures, expected 1 or {n} [Pa]")
        if not np.isfinite(values).all():
            self._refuse("not a number", f"got {values.tolist()}, expected finite pressures [Pa]")
        if (values < 0.0).any() or (values > highest).any():
            self._refuse("over limit", f"got {values.tolist()} Pa, expected 0 ... {highest:g} Pa (gauge)")
        self._target = np.broadcast_to(values, (n,)).copy()
        self._commanded_at = self._clock()
        self.accepted += 1

    def arm(self, obstacles: Sequence[str] = ()) -> None:
        """Pass commands on from now.

        Args:
            obstacles: What speaks against it, in words.

        Raises:
            BridgeError: Something speaks against it; nothing changed.
        """
        if self.mode is not Mode.LIVE:
            raise BridgeError(f"mode {self.mode.value} commands nothing; start the bridge with mode live")
        if self.state is GateState.ARMED:
            raise BridgeError("it is armed already")
        if obstacles:
            raise BridgeError(f"not armed: {'; '.join(obstacles)}")
        self.state, self.reason = GateState.ARMED, ""
        self._target = np.zeros_like(self._target)
        self._setpoint = np.zeros_like(self._setpoint)
        self._commanded_at = self._vented_at = None

    def disarm(self, reason: str = "disarmed by the operator") -> bool:
        """Vent and refuse commands until armed again; return whether it was armed."""
        armed = self.state is GateState.ARMED
        if armed:
            self._vent(reason)
        return armed

    def trip(self, reason: str) -> bool:
        """Vent because something is wrong; return whether it was armed."""
        armed = self.disarm(reason)
        self.trips += armed
        return armed

    def tick(self) -> np.ndarray | None:
        """Go on to the present; return the set-points to send, gauge [Pa], shape (n_arms,), or None for nothing."""
        now = self._clock()
        duration, self._ticked_at = now - self._ticked_at, now
        if self.state in (GateState.CLOSED, GateState.DISARMED):
            return None
        timeout = self.limits.command_timeout
        if (
            self._commanded_at is not None
            and self.state is GateState.ARMED
            and now - self._commanded_at > timeout
        ):
            self.trip(f"no command for {timeout:g} s")
        if self.state is GateState.ARMED:
            self._setpoint = self.limits.step(self._setpoint, self._target, duration)
        else:
            self._setpoint = self.limits.vent(self._setpoint, duration)
        return np.array(self._setpoint)

    def _vent(self, reason: str) -> None:
        self.state, self.reason = GateState.VENTED, reason
        self._target = np.zeros_like(self._target)
        self._vented_at = self._clock()

    def count_refusal(self, reason: str, detail: str) -> None:
        """Count a refusal; also of what is no command at all, such as bytes that cannot be read."""
        self.refused[reason] += 1
        self.last_refusal = f"{reason}: {detail}"

    def _refuse(self, reason: str, detail: str) -> None:
        self.count_refusal(reason, detail)
        raise BridgeError(self.last_refusal)

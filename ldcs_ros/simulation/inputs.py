"""`Inputs`: the present commands; each command is checked whole before anything changes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ldcs_ros.errors import CommandError
from ldcs_ros.physics.inputs import ChamberPressure, HeldCommands, ScheduledCommand, Wrench
from ldcs_ros.physics.model import Model

# Time [s] and target gauge pressure of each arm [Pa] of a command whose dead time has not passed; None: as before.
PendingTargets = tuple[float, tuple[float | None, ...]]


@dataclass(frozen=True)
class InputsState:
    """The changing part of `Inputs`.

    Attributes:
        pressure: Commanded gauge pressure of each arm [Pa], or None without a pressure drive.
        torque: Commanded torque of each joint [N m], or None without a torque drive.
        wrenches: Held wrenches by frame name.
        chambers: Pressure in each arm's chamber.
        pending: Pressure commands whose dead time has not passed, by time.
        overridden: Quantities and frames that the schedule no longer commands.
    """

    pressure: np.ndarray | None
    torque: np.ndarray | None
    wrenches: dict[str, Wrench]
    chambers: tuple[ChamberPressure, ...]
    pending: tuple[PendingTargets, ...]
    overridden: frozenset[str]


class Inputs:
    """Commands of a simulation; each `set_...` takes effect at the present simulation time or is refused whole.

    A repeated command costs nothing.

    Attributes:
        pressure: Commanded gauge pressure of each arm [Pa], shape (n_arms,), or None without a pressure drive.
        torque: Commanded torque of each joint [N m], shape (n_arms, n_links), or None without a torque drive.
        wrenches: Held wrenches by frame name.
        version: Counts the changes.
    """

    def __init__(self, model: Model, clock: Callable[[], float]) -> None:
        self._model, self._clock = model, clock
        self._arms = None if model.arms is None else model.arms.arms
        self._each = () if model.arms is None else model.arms.each
        self._names = () if model.arms is None else model.arms.names
        self._links = 0 if model.arms is None else model.arms.n_links
        self._torque_limit = np.array([own.torque_limit for own in self._each])
        self._least_torque_limit = float(self._torque_limit.min(initial=math.inf))
        self._pressure_limit = [own.pressure_limit for own in self._each]
        self._least_pressure_limit = min(self._pressure_limit, default=math.inf)
        # Each dead time [s] with whether it is that of an arm's valve.
        self._dead_times = tuple(
            (dead_time, tuple(own.dead_time == dead_time for own in self._each))
            for dead_time in sorted({own.dead_time for own in self._each})
        )
        self._known_pressures: dict[int, tuple[float, ...]] = {}
        self.version = 0
        self.clear()

    def clear(self) -> None:
        """Return to the start: no torque, vented chambers, no wrench."""
        arms, self.wrenches = self._arms, dict[str, Wrench]()
        n = len(self._each)
        self.torque = np.zeros((n, self._links)) if arms is not None and arms.drive == "torque" else None
        self.pressure: np.ndarray | None = None
        self._chambers: tuple[ChamberPressure, ...] = ()
        if arms is not None and arms.drive == "pressure":
            self.pressure = np.zeros(n)
            self._chambers = tuple(
                ChamberPressure(0.0, 0.0, 0.0, own.fill_time, own.vent_time) for own in self._each
            )
        self._pending: tuple[PendingTargets, ...] = ()
        self._overridden: frozenset[str] = frozenset()
        self.version += 1

    def set_pressure(self, value: ArrayLike) -> None:
        """Command gauge pressures [Pa]: one number for all arms, or one an arm in the order of the scene.

        Raises:
            CommandError: No pressure drive, wrong size, not finite, or outside 0 ... pressure_limit.
        """
        self._apply_pressure(value)
        self._override("pressure")

    def _apply_pressure(self, value: object) -> None:
        self._hold_pressure(self._checked_pressure(value), self.time)

    def _checked_pressure(self, value: object) -> tuple[float, ...]:
        """Return the pressure of each arm [Pa]; raises as `set_pressure`."""
        self._check_drive("pressure")
        n, limits = len(self._each), self._pressure_limit
        # A number alone takes a tenth of the time this way; the next lines say what is wrong with others.
        if isinstance(value, float) and 0.0 <= value <= self._least_pressure_limit:
            return n * (float(value),)
        given = self._numbers(value, "pressure", "Pa", ((), (n,)))
        targets = tuple(np.broadcast_to(given, (n,)).tolist())
        if any(not 0.0 <= p <= limit for p, limit in zip(targets, limits, strict=True)):
            raise CommandError(
                f"pressure: got {_shown(given)} Pa, expected 0 ... {self._of_each(np.array(limits))} Pa (gauge)"
            )
        return targets

    def _hold_pressure(self, targets: tuple[float, ...], now: float) -> None:
        if self.pressure is not None and targets == tuple(self.pressure.tolist()):
            return
        self.pressure = np.array(targets)
        for dead_time, answers in self._dead_times:
            if dead_time > 0.0:
                answering = tuple(p if is_own else None for p, is_own in zip(targets, answers, strict=True))
                pending = [*self._pending, (now + dead_time, answering)]
                pending.sort(key=lambda one: one[0])
                self._pending = tuple(pending)
            else:
                self._set_targets(
                    now, tuple(p if is_own else None for p, is_own in zip(targets, answers, strict=True))
                )
        self.version += 1

    def set_torque(self, value: ArrayLike) -> None:
        """Command joint torques [N m]: one number, one an arm in the order of the scene, or shape (n_arms, n_links).

        Raises:
            CommandError: No torque drive, wrong size, not finite, or above torque_limit.
        """
        self._apply_torque(value)
        self._override("torque")

    def _apply_torque(self, value: object) -> None:
        self._check_drive("torque")
        n, links = len(self._each), self._links
        torque, limit = np.empty((n, links)), self._torque_limit
        # A number alone takes a tenth of the time this way; the next lines say what is wrong with others.
        if isinstance(value, float) and abs(value) <= self._least_torque_limit:
            torque[:] = value
        else:
            given = self._numbers(value, "torque", "N m", ((), (n,), (n, links)))
            torque[:] = given[:, None] if given.shape == (n,) else given
            if (np.abs(torque) > limit[:, None]).any():
                raise CommandError(
                    f"torque: got {_shown(given)} N m, expected at most {self._of_each(limit)} N m"
                )
        if self.torque is not None and (torque == self.torque).all():
            return
        self.torque = torque
        self.version += 1

    def set_wrench(
        self, frame: str, *, force: ArrayLike = (0.0, 0.0, 0.0), torque: ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        """Hold a force [N] and torque [N m] at a frame: a point's name, `node_<layer>_<i>_<j>`, or one with `_aligned`.

        Raises:
            CommandError: The scene has no wrench effect, no such frame, or the values are not sound.
        """
        self._apply_wrench(frame, force, torque)
        self._override(frame)

    def check_wrench(
        self, frame: str, *, force: ArrayLike = (0.0, 0.0, 0.0), torque: ArrayLike = (0.0, 0.0, 0.0)
    ) -> Wrench:
        """Return the wrench that `set_wrench` would hold, without holding it.

        Raises:
            CommandError: As `set_wrench`.
        """
        term = self._model.wrench
        if term is None:
            raise CommandError(
                "wrench: the scene does not name the effect 'wrench'; add '- {type: wrench}' to its effects"
            )
        try:
            term.frame(frame)
        except ValueError as error:
            raise CommandError(f"wrench: unknown frame: {error}, or one of these with '_aligned'") from error
        held = {}
        for name, value, limit in (
            ("force", force, term.effect.force_limit),
            ("torque", torque, term.effect.torque_limit),
        ):
            vector = self._numbers(value, f"wrench.{name}", "N m" if name == "torque" else "N", ((3,),))
            if float(np.linalg.norm(vector)) > limit:
                raise CommandError(
                    f"wrench.{name}: got {_shown(vector)}, expected a magnitude of at most {limit:g}"
                )
            held[name] = (float(vector[0]), float(vector[1]), float(vector[2]))
        return Wrench(**held)

    def _apply_wrench(self, frame: str, force: ArrayLike, torque: ArrayLike) -> None:
        wrench = self.check_wrench(frame, force=force, torque=torque)
        if self.wrenches.get(frame) != wrench:
            self.wrenches = {**self.wrenches, frame: wrench}
            self.version += 1

    def clear_wrench(self, frame: str) -> None:
        """Remove the wrench at a frame, if there is one."""
        self.wrenches = {name: wrench for name, wrench in self.wrenches.items() if name != frame}
        self._override(frame)
        self.version += 1

    @property
    def time(self) -> float:
        """The present simulation time [s]."""
        return self._clock()

    def apply_scheduled(self, command: ScheduledCommand, due: float | None = None) -> None:
        """Apply a scheduled command, except for quantities that were commanded otherwise since the start.

        Args:
            command: The command.
            due: Time at which it acts [s], not after the present; None for the present.

        Raises:
            CommandError: As the `set_...` methods.
        """
        if command.torque is not None and "torque" not in self._overridden:
            self._apply_torque(command.torque)
        if command.pressure is not None and "pressure" not in self._overridden:
            # Schedules are long, and run again and again.
            known = self._known_pressures.get(id(command))
            if known is None:
                known = self._known_pressures[id(command)] = self._checked_pressure(command.pressure)
            self._hold_pressure(known, self.time if due is None else due)
        if command.wrench is not None and command.wrench[0] not in self._overridden:
            self._apply_wrench(*command.wrench)

    def settle(self) -> None:
        """Fill every chamber to the pressure that was last commanded."""
        if self.pressure is not None:
            self._chambers = tuple(
                replace(chamber, time=self.time, pressure=float(p), target=float(p))
                for chamber, p in zip(self._chambers, self.pressure, strict=True)
            )
        self._pending = ()
        self.version += 1

    def vent(self) -> None:
        """Vent the arms: pressure 0 through the valve, or torque 0."""
        if self.pressure is not None:
            self.set_pressure(0.0)
        if self.torque is not None:
            self.set_torque(0.0)

    def chamber_pressure(self, time: float) -> np.ndarray:
        """Return the gauge pressure in each arm at a time [Pa], shape (n_arms,), or (0,) without a pressure drive."""
        return np.array([chamber.at(time) for chamber in self._chambers])

    def held(self) -> HeldCommands:
        """Return the commands that act from now until the next command or `next_valve_change`."""
        return HeldCommands(self.torque, self._chambers, self.wrenches)

    def next_valve_change(self) -> float:
        """Return the time at which a valve answers the oldest pending command [s]; infinity without one."""
        return self._pending[0][0] if self._pending else math.inf

    def apply_valve_change(self) -> None:
        """Apply the oldest pending command to the chambers."""
        (time, targets), self._pending = self._pending[0], self._pending[1:]
        self._set_targets(time, targets)
        self.version += 1

    def get_state(self) -> InputsState:
        """Return everything that changes, for `set_state`."""
        return InputsState(
            self.pressure, self.torque, self.wrenches, self._chambers, self._pending, self._overridden
        )

    def set_state(self, state: InputsState) -> None:
        """Return to a state that `get_state` gave."""
        self.pressure, self.torque, self.wrenches = state.pressure, state.torque, state.wrenches
        self._chambers, self._pending, self._overridden = state.chambers, state.pending, state.overridden
        self.version += 1

    def _set_targets(self, time: float, targets: tuple[float | None, ...]) -> None:
        self._chambers = tuple(
            chamber
            if target is None
            else ChamberPressure(time, chamber.at(time), target, chamber.fill_time, chamber.vent_time)
            for chamber, target in zip(self._chambers, targets, strict=True)
        )

    def _override(self, name: str) -> None:
        if name not in self._overridden:
            self._overridden |= {name}

    def _of_each(self, limit: np.ndarray) -> str:
        if (limit == limit[0]).all():
            return f"{limit[0]:g}"
        return ", ".join(f"{name} {value:g}" for name, value in zip(self._names, limit, strict=True))

    def _check_drive(self, drive: str) -> None:
        if self._arms is None:
            raise CommandError(
                f"{drive}: the scene has no arms; add '- {{type: arms, drive: {drive}}}' to its effects"
            )
        if self._arms.drive != drive:
            raise CommandError(
                f"{drive}: the scene's arms are driven by {self._arms.drive}; set 'drive: {drive}' in its arms"
            )

    @staticmethod
    def _numbers(value: object, what: str, unit: str, shapes: tuple[tuple[int, ...], ...]) -> np.ndarray:
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise CommandError(f"{what}: got {value!r}, expected numbers [{unit}]") from error
        if array.shape == (1,) and () in shapes:
            array = array[0]
        if array.shape not in shapes:
            raise CommandError(f"{what}: got shape {array.shape}, expected one of {list(shapes)} [{unit}]")
        if not np.isfinite(array).all():
            raise CommandError(f"{what}: got {_shown(array)}, expected finite numbers [{unit}]")
        return np.asarray(array)


def _shown(value: np.ndarray) -> str:
    return np.array2string(np.asarray(value), separator=", ", threshold=8, precision=6)

"""`Inputs`: what is commanded now; checks each command whole before anything changes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.errors import CommandError
from ldcs_ros.physics.inputs import HeldCommands, ScheduledCommand, Valve, Wrench
from ldcs_ros.physics.model import Model


class Inputs:
    """Commands of a simulation; each `set_...` takes effect at the present simulation time or is refused whole.

    A command that repeats what is commanded already costs nothing.

    Attributes:
        pressure: Commanded gauge pressure of each arm [Pa], shape (2,), or None without a pressure drive.
        torque: Commanded torque of each joint [N m], shape (2, n_links), or None without a torque drive.
        wrenches: Held wrenches by frame name.
        version: Counts the changes.
    """

    def __init__(self, model: Model, clock: Callable[[], float]) -> None:
        self._model, self._clock = model, clock
        self._arms: Any = None if model.arms is None else model.arms.arms  # type: ignore[attr-defined]
        self.version = 0
        self.clear()

    def clear(self) -> None:
        """Return to the start: no torque, vented chambers, no wrench."""
        drive = None if self._arms is None else self._arms.drive
        self.torque = np.zeros((2, self._arms.links)) if drive == "torque" else None
        self.pressure = np.zeros(2) if drive == "pressure" else None
        self.wrenches: dict[str, Wrench] = {}
        self._valves: tuple[Valve, ...] = (self._valve(0.0, 0.0, 0.0),) * 2 if drive == "pressure" else ()
        self._pending: tuple[tuple[float, tuple[float, ...]], ...] = ()
        self._live: frozenset[str] = frozenset()
        self.version += 1

    def set_pressure(self, value: Any) -> None:
        """Command gauge pressures [Pa]: one number for both arms, or (left, right).

        Raises:
            CommandError: No pressure drive, wrong size, not finite, or outside 0 ... pressure_limit.
        """
        self._take_pressure(value)
        self._live |= {"pressure"}

    def _take_pressure(self, value: Any) -> None:
        if self.pressure is None:
            raise CommandError(self._no_drive("pressure"))
        target = self._numbers(value, "pressure", "Pa", ((), (2,)))
        limit = self._arms.pressure_limit
        if (target < 0.0).any() or (target > limit).any():
            raise CommandError(f"pressure: got {_shown(target)} Pa, expected 0 ... {limit:g} Pa (gauge)")
        target = np.broadcast_to(target, (2,))
        if np.array_equal(target, self.pressure):
            return
        self.pressure = target.copy()
        targets = tuple(float(p) for p in self.pressure)
        if self._arms.dead_time > 0.0:
            self._pending += ((self._clock() + self._arms.dead_time, targets),)
        else:
            self._switch(self._clock(), targets)
        self.version += 1

    def set_torque(self, value: Any) -> None:
        """Command joint torques [N m]: one number, one an arm (left, right), or shape (2, n_links).

        Raises:
            CommandError: No torque drive, wrong size, not finite, or above torque_limit.
        """
        self._take_torque(value)
        self._live |= {"torque"}

    def _take_torque(self, value: Any) -> None:
        if self.torque is None:
            raise CommandError(self._no_drive("torque"))
        links = self._arms.links
        torque = self._numbers(value, "torque", "N m", ((), (2,), (2, links)))
        if (np.abs(torque) > self._arms.torque_limit).any():
            raise CommandError(
                f"torque: got {_shown(torque)} N m, expected at most {self._arms.torque_limit:g} N m"
            )
        if torque.shape == (2,):
            torque = torque[:, None]
        torque = np.broadcast_to(torque, (2, links))
        if np.array_equal(torque, self.torque):
            return
        self.torque = torque.copy()
        self.version += 1

    def set_wrench(self, frame: str, *, force: Any = (0.0, 0.0, 0.0), torque: Any = (0.0, 0.0, 0.0)) -> None:
        """Hold a force [N] and torque [N m] at a frame: a point's name, `node_<layer>_<i>_<j>`, or one with `_aligned`.

        Raises:
            CommandError: The scene has no wrench effect, no such frame, or the values are not sound.
        """
        self._take_wrench(frame, force, torque)
        self._live |= {frame}

    def check_wrench(
        self, frame: str, *, force: Any = (0.0, 0.0, 0.0), torque: Any = (0.0, 0.0, 0.0)
    ) -> Wrench:
        """Return what `set_wrench` would hold, without holding it.

        Raises:
            CommandError: As `set_wrench`.
        """
        term: Any = self._model.wrench
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

    def _take_wrench(self, frame: str, force: Any, torque: Any) -> None:
        wrench = self.check_wrench(frame, force=force, torque=torque)
        if self.wrenches.get(frame) != wrench:
            self.wrenches = {**self.wrenches, frame: wrench}
            self.version += 1

    def clear_wrench(self, frame: str) -> None:
        """Let go of the wrench at a frame, if there is one."""
        self.wrenches = {name: wrench for name, wrench in self.wrenches.items() if name != frame}
        self._live |= {frame}
        self.version += 1

    def follow(self, command: ScheduledCommand) -> None:
        """Take a scheduled command, except for what somebody has commanded since the start.

        Raises:
            CommandError: As the `set_...` methods.
        """
        if command.torque is not None and "torque" not in self._live:
            self._take_torque(command.torque)
        if command.pressure is not None and "pressure" not in self._live:
            self._take_pressure(command.pressure)
        if command.wrench is not None and command.wrench[0] not in self._live:
            self._take_wrench(*command.wrench)

    def settle(self) -> None:
        """Let every chamber have the pressure that was last commanded."""
        if self.pressure is not None:
            self._valves = tuple(self._valve(self._clock(), float(p), float(p)) for p in self.pressure)
        self._pending = ()
        self.version += 1

    def vent(self) -> None:
        """Vent the arms: pressure 0 through the valve, or torque 0."""
        if self.pressure is not None:
            self.set_pressure(0.0)
        if self.torque is not None:
            self.set_torque(0.0)

    def chamber_pressure(self, time: float) -> np.ndarray:
        """Return the gauge pressure in each arm at a time [Pa], shape (2,), or (0,) without a pressure drive."""
        return np.array([valve.at(time) for valve in self._valves])

    def held(self) -> HeldCommands:
        """Return what acts from now until the next command or `next_switch`."""
        return HeldCommands(self.torque, self._valves, self.wrenches)

    def next_switch(self) -> float:
        """Return when a valve answers a command that is on its way [s], or infinity."""
        return self._pending[0][0] if self._pending else math.inf

    def switch(self) -> None:
        """Let the valves answer the next command on its way."""
        (time, targets), self._pending = self._pending[0], self._pending[1:]
        self._switch(time, targets)
        self.version += 1

    def snapshot(self) -> Any:
        """Return everything that changes, for `restore`."""
        return self.pressure, self.torque, self.wrenches, self._valves, self._pending, self._live

    def restore(self, snapshot: Any) -> None:
        """Take back a snapshot."""
        self.pressure, self.torque, self.wrenches, self._valves, self._pending, self._live = snapshot
        self.version += 1

    def _valve(self, time: float, pressure: float, target: float) -> Valve:
        return Valve(time, pressure, target, self._arms.fill_time, self._arms.vent_time)

    def _switch(self, time: float, targets: tuple[float, ...]) -> None:
        self._valves = tuple(
            self._valve(time, valve.at(time), target)
            for valve, target in zip(self._valves, targets, strict=True)
        )

    def _no_drive(self, kind: str) -> str:
        if self._arms is None:
            return f"{kind}: the scene has no arms; add '- {{type: arms, drive: {kind}}}' to its effects"
        return f"{kind}: the scene's arms are driven by {self._arms.drive}; set 'drive: {kind}' in its arms"

    @staticmethod
    def _numbers(value: Any, what: str, unit: str, shapes: tuple[tuple[int, ...], ...]) -> np.ndarray:
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

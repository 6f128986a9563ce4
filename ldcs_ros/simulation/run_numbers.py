"""The numbers of a scene by which a run is differentiated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands, ScheduledCommand
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.inputs import Inputs, InputsState
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.scene_number import SceneNumber
from ldcs_ros.simulation.schedule import Schedule
from ldcs_ros.simulation.sensitivity import positions

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.number_kernel import NumberKernel

# Central differences of forces that are smooth in a number: truncation and rounding are below 1e-8 of the slope.
RELATIVE_STEP = 1e-4


class NumberColumn:
    """A number of the scene: central differences of the force at the run's own motion.

    Args:
        number: The number.
        scene: The scene.
        model: Its model.
        of: Names of the places.
        inputs: State of the inputs at the start of the run; None to run the schedule from the scene's start.
        time: Time of the start [s].
        settled: The run starts at rest under its commands.

    Raises:
        ValueError: The number changes the free coordinates, or times of commands or valves.
    """

    def __init__(
        self,
        number: SceneNumber,
        scene: Problem,
        model: Model,
        of: Sequence[str],
        *,
        inputs: InputsState | None,
        time: float,
        settled: bool,
    ) -> None:
        self.name, self.unit = number.path, number.unit
        self._step = number.step(RELATIVE_STEP)
        self._model = model
        self._sides: list[_Side] = []
        neighbours = [number.changed(sign * self._step) for sign in (1.0, -1.0)]
        for sign, (other, changed) in zip((1.0, -1.0), neighbours, strict=True):
            commands = _Commands(changed, other.inputs, inputs, time, settled=settled)
            if _event_times(scene, model) != _event_times(other, changed):
                raise ValueError(
                    f"{self.name} moves the time of a command or valve: a run with frozen steps has no derivative by it"
                )
            places = [point_at(other.lattice, name, other.points) for name in of]
            self._sides.append(_Side(sign, changed, commands, places))
        other, changed = neighbours[0]
        self._terms = _changed_terms(scene, model, other, changed)
        self._moves_bounds = _moves_bounds(model, changed)
        self._changes_inertia = _changes_inertia(model, changed)
        self._changes_mass = self._changes_inertia or not np.array_equal(changed.node_mass, model.node_mass)
        self._moves_places = other.lattice != scene.lattice or other.points != scene.points
        gains = [
            [one.pressure_gain for one in side.model.arms.each] if side.model.arms else []
            for side in self._sides
        ]
        self._changes_drive = gains[0] != gains[1]
        self._kernel = self._compiled()

    def _compiled(self) -> NumberKernel | None:
        ahead, before = (side.model for side in self._sides)
        if self._moves_bounds or not (is_covered(ahead) and is_covered(before)):
            return None
        from ldcs_ros.integrators.implicit.number_kernel import NumberKernel

        names = {self._model.terms[k].name for k in self._terms}
        return NumberKernel((ahead, before), 2.0 * self._step, names, changes_inertia=self._changes_inertia)

    def enter(self, time: float) -> None:
        """Begin a step at a time [s]."""
        for _, _, commands, _ in self._sides:
            commands.advance(time)

    def fill_forces(
        self, times: np.ndarray, q: np.ndarray, u: np.ndarray, a: np.ndarray, slopes: np.ndarray
    ) -> None:
        """Write d(f - M a)/d(number) of the free coordinates at instants of a step.

        Args:
            times: Times [s], shape (n,).
            q: Coordinates [m, rad], a row each.
            u: Their rates.
            a: Accelerations of the free coordinates.
            slopes: The result, shape (n, n_free).
        """
        if self._kernel is not None and not any(side.commands.held.wrenches for side in self._sides):
            self._kernel.fill(self._drives(times), q, u, a, slopes)
            return
        for row, *instant in zip(slopes, times, q, u, a, strict=True):
            ahead, before = (self._force(side, *instant) for side in self._sides)
            row[:] = (ahead - before) / (2.0 * self._step)

    def _drives(self, times: np.ndarray) -> np.ndarray:
        """Return the drive torques of both sides, shape (2, n, n_arms, n_links); 0 where they are the same."""
        arms = self._model.arms
        if arms is None:
            return np.zeros((2, len(times), 0, 0))
        if not self._changes_drive and _same_commands(*(side.commands.held for side in self._sides)):
            return np.zeros((2, len(times), arms.n_arms, arms.n_links))
        return np.stack(
            [side.model.arms.drive_torques(times, side.commands.held) for side in self._sides]  # type: ignore[union-attr]
        )

    def _force(self, side: _Side, time: float, q: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
        model = side.model
        total = np.zeros(model.n_coordinates)
        there, rate = self._there(model, time, q, u)
        for k in range(len(model.terms)) if self._moves_bounds else self._terms:
            model.terms[k].add_force(time, there, rate, side.commands.held, total)
        force = total[model.free]
        if self._changes_mass:
            force -= model.momentum(there, a)
        return force

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return how the scene's own start moves, coordinates and rates, shape (n_free,) each."""
        (q1, u1), (q0, u0) = (model.reference_state() for _, model, _, _ in self._sides)
        free, width = self._model.free, 2.0 * self._step
        return (q1 - q0)[free] / width, (u1 - u0)[free] / width

    def explicit(self, time: float, q: np.ndarray) -> np.ndarray | float:
        """Return how the places move while free coordinates stay, shape (3 n_of,), of q, shape (n_coordinates,).

        Clamped nodes move with the number, and so do places on the sheet. 0.0 where it moves neither.
        """
        if not (self._moves_places or self._moves_bounds):
            return 0.0
        ahead, before = (
            positions(places, self._there(model, time, q, 0.0 * q)[0]) for _, model, _, places in self._sides
        )
        return np.asarray((ahead - before) / (2.0 * self._step))

    def _there(
        self, model: Model, time: float, q: np.ndarray, u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        if not self._moves_bounds:
            return q, u
        q, u = q.copy(), u.copy()
        model.prescribe(time, q, u)
        return q, u


class _Side(NamedTuple):
    """A neighbour of the scene, a step of the number ahead (1) or before (-1)."""

    sign: float
    model: Model
    commands: _Commands
    places: list[Point]


class _Commands:
    """The commands of a changed scene over a run, without its motion."""

    def __init__(
        self,
        model: Model,
        schedule: Sequence[ScheduledCommand],
        inputs: InputsState | None,
        time: float,
        *,
        settled: bool,
    ) -> None:
        self._time = 0.0
        self._inputs = Inputs(model, lambda: self._time)
        self._schedule = Schedule(schedule, self._inputs)
        if inputs is not None:
            each = () if model.arms is None else model.arms.each
            chambers = tuple(
                replace(chamber, fill_time=own.fill_time, vent_time=own.vent_time)
                for chamber, own in zip(inputs.chambers, each, strict=False)
            )
            self._inputs.set_state(replace(inputs, chambers=chambers))
            self._schedule.position = sum(command.time <= time + TIME_TOLERANCE for command in schedule)
        self.advance(time)
        if settled:
            self._inputs.settle()
        self.held = self._inputs.held()

    def advance(self, time: float) -> None:
        """Apply everything up to a time [s]."""
        while (event := self._schedule.next_event()) <= time + TIME_TOLERANCE:
            self._time = max(event, 0.0)
            self._schedule.run_events(event)
        self._time = time
        self.held = self._inputs.held()


def _changes_inertia(model: Model, changed: Model) -> bool:
    q, _ = model.reference_state()
    # Bent arms: straight ones hide a part.
    q[3 * model.lattice.n_nodes :] = 0.3 * np.arange(1, model.n_angles + 1)
    own, other = model.inertia(q), changed.inertia(q)
    return own is not None and other is not None and not np.array_equal(own, other)


def _same_commands(one: HeldCommands, other: HeldCommands) -> bool:
    same_torque = one.torque is other.torque or (
        one.torque is not None and other.torque is not None and np.array_equal(one.torque, other.torque)
    )
    return same_torque and one.chambers == other.chambers


def _moves_bounds(model: Model, changed: Model) -> bool:
    """Return whether prescribed coordinates or their course differ."""
    (q, _), (other, _) = model.reference_state(), changed.reference_state()
    bounds = [[one.effects[one.terms.index(term)] for term in one.prescribing] for one in (model, changed)]
    return bounds[0] != bounds[1] or not np.array_equal(
        np.delete(q, model.free), np.delete(other, model.free)
    )


def _event_times(scene: Problem, model: Model) -> tuple[list[float], list[float]]:
    dead_times = [] if model.arms is None else [own.dead_time for own in model.arms.each]
    return [command.time for command in scene.inputs], dead_times


def _changed_terms(scene: Problem, model: Model, other: Problem, changed: Model) -> list[int]:
    """Return the terms whose force may differ; all where lattice, places, material, schedule or gravity do."""
    everything = list(range(len(model.terms)))
    if any(getattr(scene, part) != getattr(other, part) for part in ("lattice", "points", "material")):
        return everything
    if scene.inputs != other.inputs:
        return [k for k in everything if model.terms[k].commanded or model.effects[k] != changed.effects[k]]
    effects = [effect != twin for effect, twin in zip(model.effects, changed.effects, strict=True)]
    names = [effect.name for effect in model.effects]
    if any(differs and name == "gravity" for differs, name in zip(effects, names, strict=True)):
        return everything
    heavier = not np.array_equal(model.node_mass, changed.node_mass)
    return [k for k in everything if effects[k] or (heavier and names[k] == "gravity")]

"""The numbers by which a run is differentiated: commands, numbers of the scene, and its start."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeGuard

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands, ScheduledCommand
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.command_directions import (
    AXES,
    KINDS,
    CommandDirection,
    OperatingPoint,
    command_directions,
)
from ldcs_ros.simulation.inputs import Inputs, InputsState
from ldcs_ros.simulation.linear_model import natural_modes, stiffness_and_damping
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.scene_number import SceneNumber
from ldcs_ros.simulation.schedule import Schedule
from ldcs_ros.simulation.sensitivity import positions

# Central differences of forces that are smooth in a number: truncation and rounding are below 1e-8 of the slope.
RELATIVE_STEP = 1e-4
# A force whose second difference over that step is below this part of the first is linear in the number.
AFFINE = 1e-7
_START = re.compile(r"^start\.(position|velocity)\.(?:mode_(\d+)|(\w+)\.([xyz]))$")


@dataclass(frozen=True)
class CommandProfile:
    """A change of one command over a run, by which the run is differentiated.

    Attributes:
        name: Its name.
        command: `pressure.left`, `torque.left_joint_2`, `wrench.P1.force.z`.
        time: Times at which the change takes another value, those of scheduled commands [s], rising.
        amplitude: Change from each time on, per unit of the profile, same length.
    """

    name: str
    command: str
    time: tuple[float, ...]
    amplitude: tuple[float, ...]


@dataclass(frozen=True)
class StartProfile:
    """A change of a run's start, by which the run is differentiated.

    Attributes:
        name: Its name.
        position: Change of the free coordinates per unit of the profile, shape (n_free,).
        velocity: Change of their rates, same shape.
    """

    name: str
    position: np.ndarray
    velocity: np.ndarray


class CommandColumns:
    """Commands that are higher: for the whole run, from one time of the schedule to the next, or by a profile.

    The force is linear in commands. A chamber follows its target by a first-order lag, solved exactly, so its
    pressure has a tangent of its own.

    Args:
        at: The start of the run.
        schedule: The commands to come.
        commands: `pressure.left` for the whole run, `pressure.left@0.8` for the command of 0.8 s, or a profile.
        dead_time: Dead time of each arm's valve [s].
        settled: The run starts at rest under its commands.

    Attributes:
        names: Name of each column.
        units: SI unit of each column.

    Raises:
        ValueError: There is no such command, or none at that time.
    """

    def __init__(
        self,
        at: OperatingPoint,
        schedule: Sequence[ScheduledCommand],
        commands: Sequence[str | CommandProfile],
        dead_time: Sequence[float],
        *,
        settled: bool,
    ) -> None:
        self._model = at.model
        profiles = [one for command in commands for one in _profiles(at, schedule, command)]
        self.names = tuple(profile.name for profile, _ in profiles)
        self.units = tuple(one.unit for _, one in profiles)
        self._channels = list({one.name: one for _, one in profiles}.values())
        known = [one.name for one in self._channels]
        self._channel = np.array([known.index(one.name) for _, one in profiles], dtype=int)
        pressures = [one.name.startswith("pressure.") for _, one in profiles]
        self._chamber = np.array(
            [
                at.arm_names.index(one.name.partition(".")[2]) if is_pressure else -1
                for (_, one), is_pressure in zip(profiles, pressures, strict=True)
            ],
            dtype=int,
        )
        delay = np.append(dead_time, 0.0)[self._chamber]
        self._profiles = [
            (np.array(profile.time) + late, np.array((0.0, *profile.amplitude)))
            for (profile, _), late in zip(profiles, delay, strict=True)
        ]
        self._on = np.array([time[0] for time, _ in self._profiles])
        # Chambers of a settled start have their commanded pressure.
        self._pressure = np.where(settled & np.isneginf(self._on), 1.0, 0.0)
        self._target = np.zeros(len(self._on))
        self._time, self._rate = at.time, np.zeros(len(self._on))
        self._held = at.now

    @property
    def begun(self) -> np.ndarray:
        """Whether each column has moved anything yet, shape (k,)."""
        return np.asarray(self._on <= self._time + TIME_TOLERANCE)

    def enter(self, time: float, held: HeldCommands) -> None:
        """Begin a step at a time [s] with the commands that act during it."""
        self._pressure = self._amplitude(time)
        self._time, self._held = time, held
        self._target = np.array(
            [
                amplitude[np.searchsorted(times, time + TIME_TOLERANCE, side="right")]
                for times, amplitude in self._profiles
            ]
        )
        constants = np.array([*(chamber.time_constant for chamber in held.chambers), 0.0])
        with np.errstate(divide="ignore"):
            self._rate = 1.0 / constants[self._chamber]

    def forces(self, time: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return d(force)/d(command) of the free coordinates, shape (n_free, k)."""
        return self._scaled(time, q, u, self._amplitude(time))

    def unit_forces(self, time: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the same of commands that act in full, also of those to come."""
        return self._scaled(time, q, u, np.ones(len(self._on)))

    def _scaled(self, time: float, q: np.ndarray, u: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
        model, held = self._model, self._held
        slopes = np.zeros((len(self._channels), len(model.free)))
        for number in np.unique(self._channel[amplitude != 0.0]):
            one = self._channels[number]
            jump = model.force_jump(time, q, u, one.apply(held, 0.0), one.apply(held, one.step))
            slopes[number] = jump[model.free] / one.step
        return slopes[self._channel].T * amplitude

    def _amplitude(self, time: float) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            decay = np.exp(-self._rate * max(time - self._time, 0.0))
        decay[np.isinf(self._rate)] = 0.0
        return np.asarray(self._target + (self._pressure - self._target) * decay)


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
        self._moves_bounds = any(model.terms[k] in model.prescribing for k in self._terms)
        self._changes_mass = not np.array_equal(changed.node_mass, model.node_mass) or _changes_inertia(
            model, changed
        )
        self._moves_places = other.lattice != scene.lattice or other.points != scene.points
        self._forces = self._sides
        if not self._moves_bounds and self._is_affine(time):
            # One side and the run's own force, which the columns share, are exact then.
            base = _Commands(model, scene.inputs, inputs, time, settled=settled)
            self._forces = [self._sides[0], _Side(0.0, model, base, [])]

    def _is_affine(self, time: float) -> bool:
        # At a motion at random: a number that has no force there may act otherwise elsewhere.
        model, draw = self._model, np.random.default_rng(0)
        q, u = model.reference_state()
        n = len(model.free)
        q[model.free] += 0.1 * min(model.lattice.spacing) * draw.standard_normal(n)
        u[model.free] += 0.1 * draw.standard_normal(n)
        a = draw.standard_normal(n)
        first, second = self._sides
        if not _same_commands(first.commands.held, second.commands.held):
            return False
        ahead, before = (self._force(side, time, q, u, a) for side in self._sides)
        middle = self._force(first._replace(model=model), time, q, u, a)
        slope, bend = np.abs(ahead - before).max(), np.abs(ahead + before - 2.0 * middle).max()
        return bool(slope > 0.0 and bend <= AFFINE * slope)

    def enter(self, time: float) -> None:
        """Begin a step at a time [s]."""
        for _, _, commands, _ in self._forces:
            commands.advance(time)

    def force(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        a: np.ndarray,
        shared: dict[tuple[object, ...], np.ndarray],
    ) -> np.ndarray:
        """Return d(f - M a)/d(number) of the free coordinates, shape (n_free,).

        Args:
            time: Time [s].
            q: Coordinates [m, rad].
            u: Their rates.
            a: Accelerations of the free coordinates.
            shared: Forces of the run's own numbers at this motion by their terms; filled in here.
        """
        ahead, before = self._forces
        slope = self._force(ahead, time, q, u, a)
        if before.sign == 0.0:
            key = (*self._terms, self._changes_mass)
            if key not in shared:
                shared[key] = self._force(before, time, q, u, a)
            slope -= shared[key]
        else:
            slope -= self._force(before, time, q, u, a)
        slope /= (1.0 - before.sign) * self._step
        return slope

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
        """Return how the places move with free coordinates at rest: clamped nodes, and places on the sheet."""
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
    """A neighbour of the scene, a step of the number ahead (1) or before (-1), or the scene itself (0)."""

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
    torques = [held.torque for held in (one, other) if held.torque is not None]
    return (
        one.chambers == other.chambers
        and one.wrenches == other.wrenches
        and (not torques or np.array_equal(torques[0], torques[-1]))
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


class StartColumns:
    """Coordinates and rates at the start of a run.

    Args:
        at: The start.
        columns: `start.position.node_top_8_4.z`, `start.velocity.mode_2`: a coordinate or rate of a free node, or a
            natural mode around the start, whose largest displacement is 1 m; or a profile.

    Attributes:
        names: Name of each column.
        units: SI unit of each column.
        q: Tangent of the coordinates at the start, shape (n_free, k).
        u: Tangent of the rates.

    Raises:
        ValueError: There is no such node or mode, or it is held.
    """

    def __init__(self, at: OperatingPoint, columns: Sequence[str | StartProfile]) -> None:
        names = [one if isinstance(one, str) else one.name for one in columns]
        self.names, n = tuple(names), len(at.model.free)
        matches = [_START.match(one) if isinstance(one, str) else None for one in columns]
        modes = [0 if match is None else int(match[2] or 0) for match in matches]
        shapes = start_modes(at, max(modes)) if 0 < max(modes, default=0) <= n else np.zeros((n, 0))
        self.q, self.u = np.zeros((n, len(names))), np.zeros((n, len(names)))
        units = []
        for k, (one, name, match, mode) in enumerate(zip(columns, names, matches, modes, strict=True)):
            if isinstance(one, StartProfile):
                self.q[:, k], self.u[:, k] = one.position, one.velocity
                units.append("")
                continue
            if match is None or (match[2] is not None and not 1 <= mode <= n):
                raise ValueError(
                    f"got {name!r}, expected start.position or start.velocity of mode_1 to mode_{n} "
                    "or of node_<layer>_<i>_<j>.<axis>"
                )
            is_position = match[1] == "position"
            column = shapes[:, mode - 1] if mode else _of_node(at.model, name, match[3], match[4])
            (self.q if is_position else self.u)[:, k] = column
            units.append("m" if is_position else "m/s")
        self.units = tuple(units)


def start_modes(at: OperatingPoint, count: int) -> np.ndarray:
    """Return the lowest natural modes around a state, shape (n_free, count).

    The largest displacement of each is 1 m.
    """
    by_q, _ = stiffness_and_damping(at.model, at.time, at.q, 0.0 * at.u, at.now)
    shapes = natural_modes(at.model, at.q, by_q, count)[1]
    nodes = shapes[: at.model.n_free_nodes]
    largest = np.take_along_axis(nodes, np.abs(nodes).argmax(axis=0)[None], axis=0)
    return np.asarray(shapes / np.where(largest == 0.0, 1.0, largest))


def _of_node(model: Model, name: str, node: str, axis: str) -> np.ndarray:
    nodes = point_at(model.lattice, node, model.points).nodes
    coordinate = 3 * int(nodes[0]) + AXES.index(axis)
    column = (model.free == coordinate).astype(float)
    if len(nodes) > 1 or not column.any():
        raise ValueError(f"got {name!r}, expected a node that is free along {axis}")
    return column


def is_command(name: str | CommandProfile | StartProfile) -> TypeGuard[str | CommandProfile]:
    """Return whether a name is that of a command."""
    return isinstance(name, CommandProfile) or (isinstance(name, str) and name.partition(".")[0] in KINDS)


def _profiles(
    at: OperatingPoint, schedule: Sequence[ScheduledCommand], command: str | CommandProfile
) -> list[tuple[CommandProfile, CommandDirection]]:
    if isinstance(command, CommandProfile):
        (one,) = command_directions(at, command.command)
        return [(command, one)]
    kind, at_time, text = command.partition("@")
    found = []
    for one in command_directions(at, kind):
        if at_time:
            begin, end = _interval(schedule, one.name, command, _time(command, text))
            profile = CommandProfile(f"{one.name}@{begin:.12g}", one.name, (begin, end), (1.0, 0.0))
        else:
            profile = CommandProfile(one.name, one.name, (-math.inf,), (1.0,))
        found.append((profile, one))
    return found


def _time(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"got {name!r}, expected the time of a scheduled command after the @, in s"
        ) from None


def _frame(command: ScheduledCommand) -> str | None:
    return None if command.wrench is None else command.wrench[0]


def _interval(
    schedule: Sequence[ScheduledCommand], channel: str, name: str, time: float
) -> tuple[float, float]:
    """Return when the command of a time acts: from then to the next of its kind [s]."""
    kind, _, rest = channel.partition(".")
    frame = rest.partition(".")[0]
    times = [
        command.time
        for command in schedule
        if (getattr(command, kind) is not None if kind != "wrench" else _frame(command) == frame)
    ]
    found = [k for k, when in enumerate(times) if abs(when - time) <= TIME_TOLERANCE]
    if not found:
        listed = ", ".join(f"{when:g}" for when in times[:10]) or "none"
        raise ValueError(f"got {name!r}, expected a time of the scene's schedule for {kind}: {listed}")
    last = found[-1]
    return times[last], times[last + 1] if last + 1 < len(times) else math.inf

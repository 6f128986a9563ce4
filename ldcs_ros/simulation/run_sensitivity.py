"""Sensitivities along a run: how places move in time with commands, numbers of the scene and the start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np
from scipy.sparse import linalg as sparse_linalg

from ldcs_ros.integrators.base import Step
from ldcs_ros.integrators.control import LOCAL_SHARE, MOST_GROWTH, SAFETY
from ldcs_ros.integrators.esdirk43 import Esdirk43
from ldcs_ros.integrators.implicit.tangents import Tangents, TangentSteps
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.points import point_at
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.command_directions import AXES, KINDS
from ldcs_ros.simulation.follower import Followed
from ldcs_ros.simulation.linear_model import mass_matrix, rest_factors, stiffness_and_damping
from ldcs_ros.simulation.run_commands import CommandColumns, CommandProfile
from ldcs_ros.simulation.run_numbers import NumberColumn
from ldcs_ros.simulation.run_starts import StartColumns, StartProfile
from ldcs_ros.simulation.scene_number import SceneNumber
from ldcs_ros.simulation.sensitivity import position_slopes, positions

# Accuracy of a scene with fixed steps [m].
USUAL_ACCURACY = 1e-5
# Linear equations of the stages keep this part of what a step may make, as the stages themselves do.
SOLVED_SHARE = 0.05
# To be compared with differences of the frozen-step run, stages and their linear equations are solved to rounding.
TIGHT_SHARE, TIGHTLY_SOLVED = 1e-5, 1e-9
# A displacement whose tangent is followed as accurately as the displacement itself [m]: a tangent's own error may be
# the asked accuracy over it, relative to its largest value so far.
DISPLACEMENT = 0.001
# A second run at so many times the accuracy shows the error of the first. Its error is larger by a factor of 3 to 30.
COARSER = 10.0
# Times in which a lasting force and a push of the start move the sheet [s].
FORCE_TIME, PUSH_TIME = 0.3, 0.01
# The tangents' own errors never ask for steps below it [s]: what is faster lasts shorter.
SHORTEST = 1e-4


@dataclass(frozen=True)
class RunSensitivity:
    """Derivatives of places along a run.

    Attributes:
        time: Times [s], shape (n_times,).
        of: Name of each place.
        to: Name of each number; a force or torque of a wrench has one for each axis.
        units: SI unit of each number, '' where the scene does not say.
        position: Positions of the places in ldcs_base [m], shape (n_times, 3 n_of), rows x, y, z of each place.
        values: Their derivatives, shape (n_times, 3 n_of, n_to) [m per unit].
        error: Stated error of each derivative, that of the place's three, same shape; None if it was not asked for.
        steps: Steps of the run.
    """

    time: np.ndarray
    of: tuple[str, ...]
    to: tuple[str, ...]
    units: tuple[str, ...]
    position: np.ndarray
    values: np.ndarray
    error: np.ndarray | None
    steps: int

    @property
    def rows(self) -> tuple[str, ...]:
        """Name of each row: P1.x, P1.y, P1.z."""
        return tuple(f"{name}.{axis}" for name in self.of for axis in AXES)


def run_sensitivity(
    simulation: Followed,
    branch: Callable[[float], Followed],
    time: Sequence[float],
    of: Sequence[str],
    to: Sequence[str | CommandProfile],
    *,
    settled: bool,
    with_error: bool,
) -> RunSensitivity:
    """Return the derivatives of places along a run; see `Simulation.run_sensitivity`.

    Args:
        simulation: The simulation, at the start of the run.
        branch: Returns a simulation that goes on from there at an accuracy [m], by the method that has tangents.
        time: Times of the derivatives [s].
        of: Names of the places.
        to: Names of the numbers.
        settled: The start is a rest state that moves with the numbers.
        with_error: State an error of each derivative.
    """
    times = np.asarray(time, dtype=float)
    if not len(times) or not np.isfinite(times).all() or (np.diff(times) < 0.0).any():
        raise ValueError("time: got no times, or times that do not rise; expected one or more, rising, in s")
    if times[0] < simulation.time:
        raise ValueError(
            f"time: got {times[0]:g} s, expected at least the present time {simulation.time:.9g} s"
        )
    accuracy = simulation.accuracy or USUAL_ACCURACY
    run = TangentRun(branch(accuracy), times, of, to, settled=settled)
    run.go()
    error = None
    if with_error:
        coarse = TangentRun(branch(COARSER * accuracy), times, of, to, settled=settled)
        coarse.go()
        # The largest so far of a place: where two errors cross, the difference of a coordinate tells nothing.
        gap = np.abs(run.values - coarse.values).reshape(len(times), len(of), 3, -1)
        largest = np.maximum.accumulate(gap.max(axis=2, keepdims=True), axis=0)
        error = np.broadcast_to(largest, gap.shape).reshape(run.values.shape)
    return RunSensitivity(times, tuple(of), run.names, run.units, run.places, run.values, error, run.steps)


class TangentRun:
    """The tangents along a run of a simulation, as its follower.

    The run's steps resolve the tangents, too: a number may set off a motion that the run itself does not have.

    Args:
        simulation: The simulation, at the start of the run.
        times: Times at which places and derivatives are wanted [s].
        of: Names of the places.
        to: Names of the numbers.
        settled: The start is a rest state that moves with the numbers.
        rest: Coordinates of that rest state where the simulation has been moved away from it.
        tight: Solve stages to rounding, for a comparison with differences of the frozen-step run.

    Attributes:
        names: Name of each number.
        units: SI unit of each number.
        places: Positions of the places [m], shape (n_times, 3 n_of).
        values: Their derivatives [m per unit], shape (n_times, 3 n_of, n_to).
        tangents: Those of all free coordinates at the end of the last step, the columns by kind of number.
        grid: Start and end of each step [s].
    """

    def __init__(
        self,
        simulation: Followed,
        times: np.ndarray,
        of: Sequence[str],
        to: Sequence[str | CommandProfile | StartProfile],
        *,
        settled: bool,
        rest: np.ndarray | None = None,
        tight: bool = False,
    ) -> None:
        assert isinstance(simulation.integrator, Esdirk43) and simulation.accuracy is not None
        self._run, self._model, self._tight = simulation, simulation.model, tight
        self._accuracy, self._end = simulation.accuracy, simulation.last_step.right
        scene, model, inputs = simulation.scene, simulation.model, simulation.inputs.get_state()
        if tight:
            simulation.integrator.iteration_share = TIGHT_SHARE
        self._rest = self._end.q if rest is None else rest
        self.tangents: Tangents | None = None
        self.grid: list[tuple[float, float]] = []
        at = simulation.operating_point()
        if settled:
            at = replace(at, now=at.held)
        own_start = at.time == 0.0 and np.array_equal(at.q, model.reference_state()[0])
        fresh = (own_start or settled) and not inputs.overridden
        commands = [name for name in to if _is_command(name)]
        others = [name for name in to if isinstance(name, str) and not _is_command(name)]
        profiles = [one for one in to if isinstance(one, StartProfile)]
        if inputs.overridden and any(isinstance(one, CommandProfile) or "@" in one for one in commands):
            raise ValueError("commands of the schedule: got a simulation that was commanded otherwise")
        each = () if model.arms is None else model.arms.each
        dead_times = [own.dead_time for own in each]
        self._commands = CommandColumns(at, scene.inputs, commands, dead_times, settled=settled)
        self._numbers = [
            NumberColumn(
                SceneNumber(scene, model, name),
                scene,
                model,
                of,
                inputs=None if fresh else inputs,
                time=at.time,
                settled=settled,
            )
            for name in others
            if not name.startswith("start.")
        ]
        starts = StartColumns(at, [*(name for name in others if name.startswith("start.")), *profiles])
        groups = [
            list(zip(self._commands.names, self._commands.units, strict=True)),
            [(column.name, column.unit) for column in self._numbers],
            list(zip(starts.names, starts.units, strict=True)),
        ]
        found = [pair for group in groups for pair in group]
        self._n_commands, n = len(groups[0]), len(found)
        self._places = [point_at(model.lattice, name, model.points) for name in of]
        self._times = times
        # Columns in the order of `to`: a name with several axes has its columns together.
        order = sorted(range(n), key=lambda k: _rank(found[k][0], to))
        self._order = np.array(order, dtype=int)
        self.names, self.units = (tuple(found[k][part] for k in order) for part in range(2))
        self.places = np.empty((len(times), 3 * len(of)))
        self.values = np.empty((len(times), 3 * len(of), n))
        self._taken_times = 0
        self._largest = np.zeros(n)
        self._steps = TangentSteps(simulation.integrator)
        start_q, start_u = np.zeros((len(model.free), n)), np.zeros((len(model.free), n))
        start_q[:, n - len(starts.names) :], start_u[:, n - len(starts.names) :] = starts.q, starts.u
        if own_start and not settled:
            for k, column in enumerate(self._numbers, self._n_commands):
                start_q[:, k], start_u[:, k] = column.start()
        self._columns = np.arange(n)
        held = at.held if settled else at.now
        self._commands.enter(at.time, held)
        if settled:
            moved = self._n_commands + len(self._numbers)
            start_q[:, :moved] = self._rest_slope(held)[:, :moved]
        self._start = start_q, start_u
        self._largest = self._scales(held)
        self._record(simulation.last_step, None)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return len(self.grid)

    def go(self) -> None:
        """Run to the last time."""
        self._run.follow(self)
        self._run.advance_to(float(self._times[-1]))

    def _scales(self, held: HeldCommands) -> np.ndarray:
        """Return the displacement that each column may cause, shape (n,), of the order of its static response."""
        motion = self._end
        q, u = motion.q, motion.u
        by_q, by_u = stiffness_and_damping(self._model, motion.time, q, u, held)
        mass = mass_matrix(self._model, q)
        forces = self._forces_at(motion.time, q, u, motion.a)
        forces[:, : self._n_commands] = self._commands.unit_forces(motion.time, q, u)
        # One implicit Euler step: long for a force that lasts, short for a push that dampers take away.
        start_q, start_u = self._start
        matrices = {h: mass - h * by_u - h * h * by_q for h in (FORCE_TIME, PUSH_TIME)}
        lasting = FORCE_TIME**2 * sparse_linalg.splu(matrices[FORCE_TIME]).solve(forces)
        pushed = PUSH_TIME * sparse_linalg.splu(matrices[PUSH_TIME]).solve(mass @ start_u)
        return np.maximum.reduce([self._steps.size(part) for part in (lasting, pushed, start_q)])

    def _rest_slope(self, held: HeldCommands) -> np.ndarray:
        # By the implicit function theorem, as in `sensitivity`.
        motion = self._end
        q, u = self._rest, np.zeros_like(motion.u)
        by_q, _ = stiffness_and_damping(self._model, motion.time, q, u, held)
        forces = self._forces_at(motion.time, q, u, np.zeros(len(self._model.free)))
        return -np.asarray(rest_factors(by_q).solve(forces))

    def _forces(self, times: np.ndarray, q: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
        result = np.zeros((len(self._columns), len(times), len(self._model.free)))
        own = self._columns[self._columns < self._n_commands]
        if own.size:
            for k, instant in enumerate(zip(times, q, u, strict=True)):
                result[: len(own), k] = self._commands.forces(*instant).T[own]
        for column, slopes in zip(self._numbers, result[len(own) :], strict=False):
            column.fill_forces(times, q, u, a, slopes)
        return np.ascontiguousarray(result.transpose(1, 0, 2))

    def _forces_at(self, time: float, q: np.ndarray, u: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the forces at one instant, shape (n_free, k)."""
        return self._forces(np.array([time]), q[None], u[None], a[None])[0].T

    def longest_step(self, step: Step, held: HeldCommands) -> float:
        """Carry the tangents over a step; return the longest step that they allow [s]."""
        left, before = step.left, self.tangents
        h = step.right.time - left.time
        self._commands.enter(left.time, held)
        for number in self._numbers:
            number.enter(left.time)
        begun = np.append(self._commands.begun, np.ones(len(self._largest) - self._n_commands, dtype=bool))
        self._columns = np.flatnonzero(begun)
        q, u = self._start if before is None else (before.q, before.u)
        self._jumped = before is None or left.a is not self._end.a or left.lasting is not None
        if self._jumped:
            start = self._steps.at_start(step, held, q[:, begun], u[:, begun], self._forces)
        else:
            assert before is not None
            start = Tangents(q[:, begun], u[:, begun], before.a[:, begun])
        decay = max(self._run.integrator.damping_rate(left, held), 0.1)
        allowed = LOCAL_SHARE * self._accuracy / DISPLACEMENT * min(1.0, decay * h)
        scale = np.maximum(self._largest[begun], self._steps.size(start.q))
        solved = TIGHTLY_SOLVED if self._tight else SOLVED_SHARE * allowed
        end, error = self._steps.advance(
            step, held, start, self._forces, tolerance=allowed * scale, solved=solved
        )
        scale = np.maximum(scale, self._steps.size(end.q))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = float(np.max(np.where(error > 0.0, error / (allowed * scale), 0.0), initial=1e-6))
        self._begun_tangents, self._ended = self._whole(start), self._whole(end)
        self._scale = scale
        longest = h * min(MOST_GROWTH, max(0.1, SAFETY * ratio ** (-1.0 / Esdirk43.error_order)))
        return max(longest, min(h, SHORTEST))

    def take(self, step: Step) -> None:
        """Go on to the end of the step that was followed last."""
        self._record(step, self._ended)
        self.tangents, self._end = self._ended, step.right
        self._largest[self._columns] = self._scale
        self.grid.append((step.left.time, step.right.time))

    def _whole(self, part: Tangents) -> Tangents:
        if len(self._columns) == len(self._largest):
            return part
        whole = [np.zeros((len(self._model.free), len(self._largest))) for _ in range(3)]
        for target, values in zip(whole, (part.q, part.u, part.a), strict=True):
            target[:, self._columns] = values
        return Tangents(*whole)

    def _record(self, step: Step, end: Tangents | None) -> None:
        """Write what the times up to the end of a step ask for."""
        h = step.right.time - step.left.time
        while self._taken_times < len(self._times):
            time = float(self._times[self._taken_times])
            if time > step.right.time + TIME_TOLERANCE:
                break
            motion = step.at(time, self._model)
            moved = self._start[0]
            if end is not None and h > 0.0:
                s = min(max((time - step.left.time) / h, 0.0), 1.0)
                moved = self._begun_tangents.toward(end, h, s, jumped=self._jumped).q
            self._write(self._taken_times, time, motion.q, moved)
            self._taken_times += 1

    def _write(self, row: int, time: float, q: np.ndarray, moved: np.ndarray) -> None:
        self.places[row] = positions(self._places, q)
        whole = np.zeros((len(q), moved.shape[1]))
        whole[self._model.free] = moved
        by = position_slopes(self._places, whole)
        for k, column in enumerate(self._numbers, self._n_commands):
            by[:, k] += column.explicit(time, q)
        self.values[row] = by[:, self._order]


def _rank(name: str, to: Sequence[str | CommandProfile | StartProfile]) -> int:
    for k, asked in enumerate(to):
        kind, _, time = asked.partition("@") if isinstance(asked, str) else (asked.name, "", "")
        own, _, when = name.partition("@") if isinstance(asked, str) else (name, "", "")
        same_time = float(time) == float(when) if time and when else time == when
        if same_time and (own == kind or own.startswith(f"{kind}.")):
            return k
    return len(to)


def _is_command(name: str | CommandProfile | StartProfile) -> TypeGuard[str | CommandProfile]:
    """Return whether a name is that of a command."""
    return isinstance(name, CommandProfile) or (isinstance(name, str) and name.partition(".")[0] in KINDS)

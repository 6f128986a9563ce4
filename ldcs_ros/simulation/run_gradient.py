"""The gradient of one figure of a run by all its scheduled commands: the tangents of its steps, transposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.integrators.base import Step
from ldcs_ros.integrators.esdirk43 import Esdirk43
from ldcs_ros.integrators.implicit.system import Factors
from ldcs_ros.integrators.implicit.tangents import EquationChoice, Tangents, stage_motions
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.points import point_at
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.command_directions import KINDS, CommandDirection, OperatingPoint, command_directions
from ldcs_ros.simulation.follower import Followed

# Part of a stage's solution that its linear equation may keep as an error.
SOLVED = 1e-6


@dataclass(frozen=True)
class RunGradient:
    """The gradient of a weighted sum of positions along a run.

    Attributes:
        value: The sum [m, by the weights].
        command: Name of each command: `pressure.left`.
        time: Time of each scheduled command [s], shape (n_times,).
        values: Derivative by each command from its time to that of the next of its kind, shape (n_times, n_commands);
            0 where the schedule has no such command at that time.
        steps: Steps of the run.
    """

    value: float
    command: tuple[str, ...]
    time: np.ndarray
    values: np.ndarray
    steps: int


@dataclass(frozen=True)
class _Kept:
    """A step of the run with its stages."""

    step: Step
    held: HeldCommands
    accelerations: np.ndarray
    factors: tuple[Factors, ...]
    jumped: bool


class StepRecord:
    """Keeps the steps of a run, as its follower; it asks for none that the run would not take."""

    def __init__(self, simulation: Followed) -> None:
        assert isinstance(simulation.integrator, Esdirk43)
        self._integrator = simulation.integrator
        self._end = simulation.last_step.right
        self.kept: list[_Kept] = []

    def longest_step(self, step: Step, held: HeldCommands) -> float:
        """Return the step's own length [s]."""
        self._held = held
        return np.inf

    def take(self, step: Step) -> None:
        """Keep a step."""
        accelerations, factors = self._integrator.last_stages
        jumped = not self.kept or step.left.a is not self._end.a or step.left.lasting is not None
        self.kept.append(_Kept(step, self._held, accelerations, tuple(factors), jumped))
        self._end = step.right


def run_gradient(
    simulation: Followed, time: Sequence[float], of: Sequence[str], weights: np.ndarray
) -> RunGradient:
    """Return the gradient of a sum of positions by the scheduled commands of a run; see `Simulation.run_gradient`.

    Args:
        simulation: The simulation, at the start of the run, with the method that has tangents.
        time: Times of the positions [s], rising.
        of: Names of places.
        weights: Weight of each coordinate in the sum, shape (n_times, 3 n_of).

    Raises:
        ValueError: The weights have another shape.
    """
    model = simulation.model
    times, weights = np.asarray(time, dtype=float), np.asarray(weights, dtype=float)
    expected = (len(times), 3 * len(of))
    if weights.shape != expected:
        raise ValueError(
            f"weights: got shape {weights.shape}, expected {expected}: x, y, z of each place at each time"
        )
    at = simulation.operating_point()
    record = StepRecord(simulation)
    simulation.follow(record)
    simulation.advance_to(float(times[-1]))
    places = [point_at(model.lattice, name, model.points) for name in of]
    rows = np.zeros((len(times), model.n_coordinates))
    for k, point in enumerate(places):
        for axis in range(3):
            rows[:, 3 * point.nodes + axis] += weights[:, 3 * k + axis, None] * point.fraction
    backward = _Backward(simulation, at, record.kept)
    value = 0.0
    looks: list[list[tuple[float, np.ndarray]]] = [[] for _ in record.kept]
    ends = np.array([one.step.right.time for one in record.kept])
    for when, row in zip(times, rows, strict=True):
        index = min(int(np.searchsorted(ends, when - TIME_TOLERANCE)), len(ends) - 1)
        value += float(row @ record.kept[index].step.at(float(when), model).q)
        looks[index].append((float(when), row[model.free]))
    for one, seen in zip(reversed(record.kept), reversed(looks), strict=True):
        backward.pass_step(one, seen)
    found = backward.by_command()
    return RunGradient(value, *found, len(record.kept))


class _Backward:
    """Carries the gradient by coordinates, rates and accelerations back over steps.

    The derivative of a stage's acceleration is W^-1 times what the stages before and the commands give, so a gradient
    by it passes W^-T; the kept factors of G W0 H^T are those of the transposed matrix, too.
    """

    def __init__(self, simulation: Followed, at: OperatingPoint, kept: Sequence[_Kept]) -> None:
        assert isinstance(simulation.integrator, Esdirk43)
        self._model, self._tableau = simulation.model, simulation.integrator.tableau
        free = len(self._model.free)
        self._q, self._u, self._a = np.zeros(free), np.zeros(free), np.zeros(free)
        self._equations = EquationChoice(simulation.integrator, np.ones(free))
        self._commands = _CommandGradient(at)

    def pass_step(self, one: _Kept, looks: Sequence[tuple[float, np.ndarray]]) -> None:
        """Go back over a step in which positions count: time [s] and gradient of each look."""
        model, tableau, step, left = self._model, self._tableau, one.step, one.step.left
        h, free, n_stages = step.right.time - left.time, model.free, len(tableau.c)
        rate_step = tableau.diagonal * h
        start_q, start_u, start_a = (np.zeros(len(free)) for _ in range(3))
        unit = np.eye(6)
        first, last = (Tangents(*unit[k : k + 3, None]) for k in (0, 3))
        for when, row in looks:
            if h <= 0.0:
                start_q += row
                continue
            (part,) = first.toward(last, h, (when - left.time) / h, jumped=one.jumped).q
            start_q += part[0] * row
            start_u += part[1] * row
            start_a += part[2] * row
            self._q, self._u, self._a = (
                gradient + weight * row
                for gradient, weight in zip((self._q, self._u, self._a), part[3:], strict=True)
            )
        by_q, by_u, by_a = np.zeros((3, n_stages, len(free)))
        by_q[-1], by_u[-1], by_a[-1] = self._q, self._u, self._a
        times, q, u = stage_motions(model, tableau, step, one.accelerations)
        equations = self._equations.under(one.held)
        pushes: list[tuple[float, np.ndarray]] = []
        contraction = 1.0
        for i in range(n_stages - 1, 0, -1):
            instant = times[i], q[i], u[i]
            row = h * tableau.a[i, :i]
            equations.linearise(*instant, one.accelerations[i], one.held)
            by_rate = by_u[i] + rate_step * by_q[i]
            right = (by_a[i] + rate_step * by_rate)[None]
            push = np.zeros_like(right)
            contraction = equations.solve(
                one.factors[i - 1], rate_step, right, push, SOLVED, contraction, transposed=True
            )
            pushes.append((times[i], self._commands.slopes(*instant, one.held, push[0])))
            by_position, by_speed = equations.transposed(push[0])
            known_q = by_q[i] + by_position
            known_u = by_rate + rate_step * by_position + by_speed
            start_q += known_q
            start_u += known_u
            by_u[:i] += row[:, None] * known_q
            by_a[:i] += row[:, None] * known_u
        start_u += by_u[0]
        start_a += by_a[0]
        if one.jumped:
            equations.linearise(left.time, left.q, left.u, left.a, one.held)
            last_push = model.inverse_mass_times(left.q, start_a.copy())
            pushes.append((left.time, self._commands.slopes(left.time, left.q, left.u, one.held, last_push)))
            by_position, by_speed = equations.transposed(last_push)
            start_q += by_position
            start_u += by_speed
            start_a = np.zeros_like(start_a)
        self._commands.pass_step(step, one.held, pushes)
        self._q, self._u, self._a = start_q, start_u, start_a

    def by_command(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Return names of commands, their times, and the gradient, shape (n_times, n_commands)."""
        return self._commands.found()


class _CommandGradient:
    """The gradient by scheduled commands, from those by the force at the stages of steps."""

    def __init__(self, at: OperatingPoint) -> None:
        self._model = at.model
        names = [f"pressure.{arm}" for arm in at.arm_names] if at.held.chambers else []
        names += [f"torque.{joint}" for joint in at.joint_names] if at.held.torque is not None else []
        schedule = at.scene.inputs
        frames = sorted({one.wrench[0] for one in schedule if one.wrench is not None})
        names += [f"wrench.{frame}.{what}" for frame in frames for what in ("force", "torque")]
        self._commands: list[CommandDirection] = [
            one for name in names for one in command_directions(at, name)
        ]
        each = () if at.model.arms is None else at.model.arms.each
        self._arms, self._times, self._acting = [], [], []
        for one in self._commands:
            kind, _, rest = one.name.partition(".")
            frame = rest.rpartition(".")[0].rpartition(".")[0]
            self._arms.append(at.arm_names.index(rest) if kind == KINDS[0] else -1)
            times = [
                command.time
                for command in schedule
                if getattr(command, kind) is not None
                and (kind != "wrench" or (command.wrench is not None and command.wrench[0] == frame))
            ]
            self._times.append(np.array(times))
            late = each[self._arms[-1]].dead_time if self._arms[-1] >= 0 else 0.0
            self._acting.append(self._times[-1] + late)
        self._values = [np.zeros(len(times)) for times in self._times]
        self._pending = np.zeros(len(self._commands))
        self._constant: dict[int, np.ndarray] = {}

    def slopes(
        self, time: float, q: np.ndarray, u: np.ndarray, held: HeldCommands, push: np.ndarray
    ) -> np.ndarray:
        """Return the gradient by each command that acts at an instant, from that by the force."""
        found = np.zeros(len(self._commands))
        for k, one in enumerate(self._commands):
            slope = self._constant.get(k)
            if slope is None:
                jump = self._model.force_jump(time, q, u, one.apply(held, 0.0), one.apply(held, one.step))
                slope = jump[self._model.free] / one.step
                if not one.name.startswith("wrench."):
                    # The arms' torques do not depend on the motion.
                    self._constant[k] = slope
            found[k] = push @ slope
        return found

    def pass_step(self, step: Step, held: HeldCommands, pushes: Sequence[tuple[float, np.ndarray]]) -> None:
        """Go back over a step; a chamber passes on what its pressure did, as it follows its target exactly."""
        later = sorted(pushes, key=lambda item: item[0], reverse=True)
        for k, arm in enumerate(self._arms):
            rate = np.inf
            if arm >= 0 and held.chambers[arm].time_constant > 0.0:
                rate = 1.0 / held.chambers[arm].time_constant
            now, pressure, target = step.right.time, self._pending[k], 0.0
            for time, by in [*later, (step.left.time, np.zeros(len(self._arms)))]:
                kept = np.exp(-rate * (now - time)) if rate < np.inf else 0.0
                target += pressure * (1.0 - kept)
                pressure, now = pressure * kept + by[k], time
            if rate == np.inf:
                target, pressure = target + pressure, 0.0
            self._pending[k] = pressure
            index = int(np.searchsorted(self._acting[k], step.left.time + TIME_TOLERANCE, side="right")) - 1
            if index >= 0:
                self._values[k][index] += target

    def found(self) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Return names of commands, all their times, and the gradient, shape (n_times, n_commands)."""
        times = np.unique(np.concatenate([np.zeros(0), *self._times]))
        values = np.zeros((len(times), len(self._commands)))
        for k, own in enumerate(self._times):
            np.add.at(values[:, k], np.searchsorted(times, own), self._values[k])
        return tuple(one.name for one in self._commands), times, values

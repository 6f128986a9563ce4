"""Dynamic targets: a piecewise linear course of commands, bounded and slew-limited, by tangents of the run."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.reach.least_squares import constrained_least_squares
from ldcs_ros.reach.reach import TargetCoordinate, Variable, commands_of
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.command_directions import AXES
from ldcs_ros.simulation.run_parameters import CommandProfile
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

# A course is done when a step lowers the distance by less than this part of it.
LEAST_GAIN = 0.01
MOST_STEPS = 12
# Weight of a knot's second difference, as a part of the command's range, beside a distance of a target [m]: where the
# targets leave commands open, the smoother course counts.
ROUGHNESS = 2e-5


@dataclass(frozen=True)
class Trajectory:
    """Coordinates that places shall have over time.

    Attributes:
        coordinates: Place and axis of each, with its weight; the values are not used.
        time: Times from the start of the run [s], shape (n,), rising.
        value: Coordinates in ldcs_base [m], shape (n, n_coordinates); NaN where one is open.
    """

    coordinates: tuple[TargetCoordinate, ...]
    time: np.ndarray
    value: np.ndarray

    def until(self, end: float) -> Trajectory:
        """Return the part up to a time [s]."""
        kept = self.time <= end * (1.0 + 1e-12)
        return replace(self, time=self.time[kept], value=self.value[kept])


@dataclass(frozen=True)
class CommandCourse:
    """A course of commands.

    Attributes:
        time: Times of the knots [s], shape (n_knots,); the first is the start of the run.
        commands: Value of each variable at the knots, by name, shape (n_knots,) each; linear between them.
        schedule: The same as entries of a scene's `inputs`: means over intervals, held during each.
        reached: Coordinates at the trajectory's times [m], shape (n, n_coordinates), of a run of the scene itself.
        rms: Root of the mean square distance of a place from its target [m].
        largest: Largest distance [m].
        at_limits: Variables that a bound or the slew rate holds somewhere.
        steps: Gauss-Newton steps.
    """

    time: np.ndarray
    commands: dict[str, np.ndarray]
    schedule: tuple[dict[str, object], ...]
    reached: np.ndarray
    rms: float
    largest: float
    at_limits: tuple[str, ...]
    steps: int


def read_trajectory(path: Path) -> Trajectory:
    """Return the trajectory of a CSV file: columns time, P1.y, P1.z, ... in s and m; an empty cell is open.

    Raises:
        ValueError: It is not such a file.
    """
    with path.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    names = [name.strip() for name in rows[0]] if rows else []
    places = [name.rpartition(".") for name in names[1:]]
    if not places or names[0] != "time" or any(not dot or axis not in AXES for _, dot, axis in places):
        raise ValueError(
            f"{path.name}: got columns {', '.join(names) or 'none'}, expected time,P1.x,P1.z or the like"
        )
    try:
        table = np.array([[float(cell) if cell.strip() else math.nan for cell in row] for row in rows[1:]])
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}, expected numbers") from error
    if table.ndim != 2 or table.shape[1] != len(names):
        raise ValueError(f"{path.name}: got rows of other lengths, expected {len(names)} numbers in each")
    time, value = table[:, 0], table[:, 1:]
    if (
        not np.isfinite(time).all()
        or (np.diff(time) <= 0.0).any()
        or time[0] < 0.0
        or not np.isfinite(value).any()
    ):
        raise ValueError(f"{path.name}: expected rising times from 0 on, and targets")
    return Trajectory(tuple(TargetCoordinate(place, axis, 0.0) for place, _, axis in places), time, value)


def find_course(
    scene: Scene,
    trajectory: Trajectory,
    variables: Sequence[Variable],
    *,
    interval: float = 0.1,
    rate: float = 50.0,
    progress: Callable[[str], None] = lambda text: None,
) -> CommandCourse:
    """Return the course of commands under which places follow a trajectory, within bounds and slew rates.

    The run begins at the rest state under the scene's commands. Gauss-Newton steps with the tangents of the run, the
    linear problem with its inequalities solved exactly. The rest states at the targets are the first guess.

    Args:
        scene: The scene.
        trajectory: The targets.
        variables: Commands that may vary, with bounds and slew rates.
        interval: Time between knots [s].
        rate: Rate of the commands, each held until the next [1/s].
        progress: Called with a line after each step.

    Raises:
        ValueError: A name is unknown, or limits leave no course.
        DivergenceError: There is no rest state to begin at, or no motion.
    """
    with one_thread():
        return _CourseProblem(scene, trajectory, variables, interval, rate).solve(progress)


class _CourseProblem:
    def __init__(
        self,
        scene: Scene,
        trajectory: Trajectory,
        variables: Sequence[Variable],
        interval: float,
        rate: float,
    ) -> None:
        self._trajectory, self._variables = trajectory, tuple(variables)
        end = float(trajectory.time[-1])
        if not end > 0.0 or not interval > 0.0 or not rate > 0.0 or not variables:
            raise ValueError("expected a trajectory longer than 0 s, knots, a rate and at least one variable")
        self._rest = scene.build()
        self._rest.settle()
        at = self._rest.operating_point()
        self._base = at.held
        self._directions = commands_of(at, variables)
        self._scene = scene
        self.knots = np.linspace(0.0, end, max(2, math.ceil(end / interval - 1e-9) + 1))
        count = math.ceil(end * rate - 1e-9)
        self._times = np.arange(count) / rate
        # A held command is the mean of the line over its interval: its value in the middle.
        middle = np.minimum(self._times + 0.5 / rate, end)
        self._hats = np.stack([np.interp(middle, self.knots, row) for row in np.eye(len(self.knots))], axis=1)
        self._low = np.array([variable.low for variable in variables])
        self._range = np.array([variable.high for variable in variables]) - self._low
        # The first knot is the command of the rest state: the course goes on from there.
        self._present = np.array([one.present(self._base) for one in self._directions])
        places: list[str] = []
        for target in trajectory.coordinates:
            places += [target.place] if target.place not in places else []
        self._of = places
        self._rows = np.array(
            [3 * places.index(target.place) + AXES.index(target.axis) for target in trajectory.coordinates]
        )
        self._weight = np.array([target.weight for target in trajectory.coordinates])
        self._asked = np.isfinite(trajectory.value)

    def solve(self, progress: Callable[[str], None]) -> CommandCourse:
        """Go down from the rest states at the targets."""
        # Fractions of the ranges at the knots after the first, shape (n_knots - 1, n_variables).
        values = self._limited(self._first_guess())
        residual, slope = self._look(values)
        steps = 0
        for steps in range(1, MOST_STEPS + 1):
            change = self._change(values, residual, slope)
            part, found = 1.0, None
            while part > 0.05:
                try:
                    found = self._look(values + part * change)
                except DivergenceError:
                    found = None
                if found is not None and np.sum(found[0] ** 2) < np.sum(residual**2):
                    break
                part, found = 0.4 * part, None
            if found is None:
                break
            before, now = (float(np.linalg.norm(r)) for r in (residual, found[0]))
            values, (residual, slope) = values + part * change, found
            progress(f"step {steps}: RMS {1e3 * self._rms(residual):.4g} mm")
            if now > (1.0 - LEAST_GAIN) * before:
                break
        return self._result(values, steps)

    def _first_guess(self) -> np.ndarray:
        """Return fractions at the knots under which the places rest near their targets, by the slopes at the start."""
        trajectory, m = self._trajectory, len(self._variables)
        found = self._rest.sensitivity(self._of, [variable.name for variable in self._variables])
        slope = self._weight[:, None] * found.values[self._rows] * self._range
        start = np.concatenate([self._rest.pose(name)[0] for name in self._of])[self._rows]
        inside = np.vstack([np.eye(m), -np.eye(m)])
        fraction = np.clip((self._present - self._low) / self._range, 0.0, 1.0)
        bounds = np.concatenate([-fraction, fraction - 1.0])
        values = []
        for time in self.knots[1:]:
            wanted = np.array([np.interp(time, trajectory.time, column) for column in trajectory.value.T])
            asked = np.isfinite(wanted)
            matrix = np.vstack([slope[asked], ROUGHNESS * np.eye(m)])
            right = np.concatenate([(self._weight * (wanted - start))[asked], np.zeros(m)])
            values.append(fraction + constrained_least_squares(matrix, right, inside, bounds))
        return np.array(values)

    def _limits(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inequalities G change >= b of bounds and slew rates at values."""
        n, m = values.shape
        each = np.eye(n * m)
        rows, bounds = [each, -each], [-values.ravel(), values.ravel() - 1.0]
        first = (self._present - self._low) / self._range
        steps = np.diff(np.vstack([first, values]), axis=0)
        most = np.array([variable.slew for variable in self._variables]) / self._range
        difference = np.kron(np.eye(n) - np.eye(n, k=-1), np.eye(m))
        allowed = (np.diff(self.knots)[:, None] * most).ravel()
        held = np.isfinite(allowed)
        rows += [difference[held], -difference[held]]
        bounds += [(-allowed - steps.ravel())[held], (-allowed + steps.ravel())[held]]
        return np.vstack(rows), np.concatenate(bounds)

    def _limited(self, values: np.ndarray) -> np.ndarray:
        """Return the nearest values within bounds and slew rates."""
        limits, bounds = self._limits(values)
        change = constrained_least_squares(np.eye(values.size), np.zeros(values.size), limits, bounds)
        return values + change.reshape(values.shape)

    def _change(self, values: np.ndarray, residual: np.ndarray, slope: np.ndarray) -> np.ndarray:
        n, m = values.shape
        first = (self._present - self._low) / self._range
        second = np.kron(np.diff(np.eye(n + 1), n=2, axis=0)[:, 1:], np.eye(m)) if n > 1 else np.zeros((0, m))
        bend = np.diff(np.vstack([first, values]), n=2, axis=0).ravel()
        # Knots that no target asks about stay where they are.
        tiny = 1e-3 * ROUGHNESS * np.eye(n * m)
        matrix = np.vstack([slope, ROUGHNESS * second, tiny])
        right = np.concatenate([-residual, -ROUGHNESS * bend, np.zeros(n * m)])
        return constrained_least_squares(matrix, right, *self._limits(values)).reshape(n, m)

    def _commands(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the variables at the knots, shape (n_knots, n_variables)."""
        # Rounding must not pass a limit of the scene.
        return np.vstack([self._present, self._low + np.clip(values, 0.0, 1.0) * self._range])

    def _schedule(self, values: np.ndarray) -> tuple[dict[str, object], ...]:
        held = self._hats @ self._commands(values)
        entries = list(self._entry(0.0, self._base, everything=True))
        for time, row in zip(self._times, held, strict=True):
            now = self._base
            for one, value in zip(self._directions, row, strict=True):
                now = one.apply(now, float(value) - one.present(now))
            entries += self._entry(float(time), now, everything=False)
        return tuple(entries)

    def _entry(self, time: float, held: HeldCommands, *, everything: bool) -> tuple[dict[str, object], ...]:
        kinds = {variable.name.partition(".")[0] for variable in self._variables}
        frames = {
            variable.name.split(".")[1] for variable in self._variables if variable.name.startswith("wrench.")
        }
        entry: dict[str, object] = {"time": time}
        if held.chambers and (everything or "pressure" in kinds):
            entry["pressure"] = [chamber.target for chamber in held.chambers]
        if held.torque is not None and (everything or "torque" in kinds):
            entry["torque"] = held.torque.tolist()
        entries = [entry] if len(entry) > 1 else []
        for frame, wrench in held.wrenches.items():
            if everything or frame in frames:
                part = {"frame": frame, "force": list(wrench.force), "torque": list(wrench.torque)}
                entries.append({"time": time, "wrench": part})
        return tuple(entries)

    def _at_rest(self, values: np.ndarray) -> Simulation:
        """Return a simulation with the schedule of values, at the rest state under the scene's commands."""
        simulation = self._scene.edited(inputs=list(self._schedule(values))).build()
        simulation.inputs.settle()
        state = self._rest.state
        simulation.start_from(state.position, link_angle=state.link_angle)
        return simulation

    def _look(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals [m] and their derivatives by the fractions of the ranges."""
        profiles = [
            CommandProfile(
                f"{variable.name}#{knot}",
                variable.name,
                tuple(self._times.tolist()),
                tuple(self._hats[:, knot].tolist()),
            )
            for knot in range(1, len(self.knots))
            for variable in self._variables
        ]
        run = self._at_rest(values).run_sensitivity(
            self._trajectory.time.tolist(), self._of, profiles, with_error=False
        )
        residual = self._weight * (run.position[:, self._rows] - self._trajectory.value)
        slope = self._weight[:, None] * run.values[:, self._rows]
        slope = slope * np.tile(self._range, len(self.knots) - 1)
        scale = 1.0 / math.sqrt(len(self._trajectory.time))
        return scale * residual[self._asked], scale * slope[self._asked]

    def _rms(self, residual: np.ndarray) -> float:
        return float(np.sqrt(np.sum(residual**2) / len(self._of)))

    def _result(self, values: np.ndarray, steps: int) -> CommandCourse:
        simulation = self._at_rest(values)
        reached = np.empty((len(self._trajectory.time), len(self._rows)))
        for row, time in enumerate(self._trajectory.time):
            simulation.advance_to(float(time))
            positions = np.concatenate([simulation.pose(name)[0] for name in self._of])
            reached[row] = positions[self._rows]
        gap = np.where(self._asked, reached - self._trajectory.value, 0.0)
        square = np.stack(
            [
                np.sum(
                    gap[:, [k for k, t in enumerate(self._trajectory.coordinates) if t.place == place]] ** 2,
                    axis=1,
                )
                for place in self._of
            ]
        )
        commands = self._commands(values)
        rates = np.abs(np.diff(commands, axis=0)) / np.diff(self.knots)[:, None]
        near = 1e-6
        at_limits = [
            variable.name
            for k, variable in enumerate(self._variables)
            if values[:, k].min() < near
            or values[:, k].max() > 1.0 - near
            or rates[:, k].max() > (1.0 - near) * variable.slew
        ]
        return CommandCourse(
            self.knots,
            {variable.name: commands[:, k] for k, variable in enumerate(self._variables)},
            self._schedule(values),
            reached,
            float(np.sqrt(square.mean())),
            float(np.sqrt(square.max())),
            tuple(at_limits),
            steps,
        )

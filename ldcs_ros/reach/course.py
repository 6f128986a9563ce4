"""Dynamic targets: a piecewise linear course of commands, bounded and slew-limited, by tangents of the run."""

from __future__ import annotations

import contextlib
import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.reach.least_squares import constrained_least_squares
from ldcs_ros.reach.reach import TargetCoordinate, Variable, commands_of, rest_course
from ldcs_ros.reach.schedule import Entries, entries
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.command_directions import AXES
from ldcs_ros.simulation.run_commands import CommandProfile
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

# A course is done when a step with slopes of its own lowers the distance by less than this part of it.
LEAST_GAIN = 0.01
# A step with slopes of an earlier course shall lower it by this part, or they are found again: that takes ten runs.
KEPT_GAIN = 0.15
MOST_STEPS = 40
SHORTEST_PART = 0.05
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
    schedule: Entries
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
    tolerance: float = 0.0,
    progress: Callable[[str], None] = lambda text: None,
) -> CommandCourse:
    """Return the course of commands under which places follow a trajectory, within bounds and slew rates.

    The run begins at the rest state under the scene's commands. The rest states at the targets are the first guess.
    Gauss-Newton steps with the tangents of a run, the linear problem with its inequalities solved exactly. A run of its
    own checks each step and updates the slopes; new tangents are found only where this leads on no longer.

    Args:
        scene: The scene.
        trajectory: The targets.
        variables: Commands that may vary, with bounds and slew rates.
        interval: Time between knots [s].
        rate: Rate of the commands, each held until the next [1/s].
        tolerance: Weighted root of the mean square distance at which the search ends [m].
        progress: Called with a line after each step.

    Raises:
        ValueError: A name is unknown, or limits leave no course.
        DivergenceError: There is no rest state to begin at, or no motion.
    """
    with one_thread():
        return _CourseProblem(scene, trajectory, variables, interval, rate).solve(tolerance, progress)


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
        weight = np.array([target.weight for target in trajectory.coordinates])
        self._scale = weight / math.sqrt(len(trajectory.time))
        self._asked = np.isfinite(trajectory.value)

    def solve(self, tolerance: float, progress: Callable[[str], None]) -> CommandCourse:
        """Go down from the rest states at the targets."""
        # Fractions of the ranges at the knots after the first, shape (n_knots - 1, n_variables).
        values = self._limited(self._first_guess())
        residual, slope = self._residual(values), self._slope(values)
        progress(f"rest states: RMS {1e3 * self._rms(residual):.4g} mm")
        steps, exact = 0, True
        while steps < MOST_STEPS and self._rms(residual) > tolerance:
            change = self._change(values, residual, slope)
            taken = self._shortened(values, change, residual)
            gain = 0.0
            if taken is not None:
                steps += 1
                part, now = taken
                gain = 1.0 - float(np.linalg.norm(now)) / float(np.linalg.norm(residual))
                step = part * change.ravel()
                # Broyden's update: the run tells how the slope has changed along the step.
                slope = slope + np.outer(now - residual - slope @ step, step) / (step @ step)
                values, residual = values + part * change, now
                progress(f"step {steps}: RMS {1e3 * self._rms(residual):.4g} mm")
            if gain < (LEAST_GAIN if exact else KEPT_GAIN):
                if exact:
                    break
                slope, exact = self._slope(values), True
            else:
                exact = False
        return self._result(values, steps)

    def _shortened(
        self, values: np.ndarray, change: np.ndarray, residual: np.ndarray
    ) -> tuple[float, np.ndarray] | None:
        """Return the longest part of a change that lowers the distance, and its residual; None where none does."""
        part = 1.0
        while part > SHORTEST_PART:
            with contextlib.suppress(DivergenceError):
                now = self._residual(values + part * change)
                if np.sum(now**2) < np.sum(residual**2):
                    return part, now
            part *= 0.4
        return None

    def _first_guess(self) -> np.ndarray:
        """Return fractions at the knots under which the places rest nearest to their targets."""
        trajectory = self._trajectory
        columns = [np.interp(self.knots[1:], trajectory.time, column) for column in trajectory.value.T]
        at = self._rest.operating_point()
        values = rest_course(at, trajectory.coordinates, self._variables, np.stack(columns, axis=1))
        return np.array((values - self._low) / self._range)

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

    def _schedule(self, values: np.ndarray) -> Entries:
        held = self._hats @ self._commands(values)
        schedule = list(entries(0.0, self._base))
        names = [variable.name for variable in self._variables]
        for time, row in zip(self._times, held, strict=True):
            now = self._base
            for one, value in zip(self._directions, row, strict=True):
                now = one.apply(now, float(value) - one.present(now))
            schedule += entries(float(time), now, names)
        return tuple(schedule)

    def _at_rest(self, values: np.ndarray) -> Simulation:
        """Return a simulation with the schedule of values, at the rest state under the scene's commands."""
        simulation = self._scene.edited(inputs=list(self._schedule(values))).build()
        simulation.inputs.settle()
        state = self._rest.state
        simulation.start_from(state.position, link_angle=state.link_angle)
        return simulation

    def _residual(self, values: np.ndarray) -> np.ndarray:
        """Return the weighted distances of a run [m]; their squares add up to the mean square."""
        return np.array((self._scale * (self._run(values) - self._trajectory.value))[self._asked])

    def _slope(self, values: np.ndarray) -> np.ndarray:
        """Return the derivatives of the residual by the fractions of the ranges, by the tangents of a run."""
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
        slope = self._scale[:, None] * run.values[:, self._rows] * np.tile(self._range, len(self.knots) - 1)
        return np.array(slope[self._asked])

    def _run(self, values: np.ndarray) -> np.ndarray:
        """Return the coordinates at the trajectory's times of a run of the scene itself [m]."""
        simulation = self._at_rest(values)
        reached = np.empty((len(self._trajectory.time), len(self._rows)))
        for row, time in enumerate(self._trajectory.time):
            simulation.advance_to(float(time))
            positions = np.concatenate([simulation.pose(name)[0] for name in self._of])
            reached[row] = positions[self._rows]
        return reached

    def _rms(self, residual: np.ndarray) -> float:
        return float(np.sqrt(np.sum(residual**2) / len(self._of)))

    def _result(self, values: np.ndarray, steps: int) -> CommandCourse:
        reached = self._run(values)
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

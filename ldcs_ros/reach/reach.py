"""`reach`: the commands within bounds whose rest state comes nearest to the targets."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import lsq_linear

from ldcs_ros.errors import DivergenceError
from ldcs_ros.physics.points import point_at
from ldcs_ros.reach.rest_states import RestStates
from ldcs_ros.reach.schedule import Entries, entries
from ldcs_ros.reach.shapes import ShapeTarget
from ldcs_ros.simulation.command_directions import AXES, CommandDirection, OperatingPoint, command_directions
from ldcs_ros.simulation.sensitivity import positions
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

MOST_STEPS = 60
# The residual's slope along each free command, over its range [m]: below it no better point is near.
OPTIMAL = 1e-10
# A distance that a step makes shorter than this part of it goes on to 0: no curvature of what remains is needed.
FALL = 0.5
# Directions that move the targets less, squared, beside the others [-]: no step resolves them.
ROUNDING = 1e-14
# Commands that differ by less, of their range, are one solution.
SAME = 1e-3


@dataclass(frozen=True)
class TargetCoordinate:
    """A coordinate that a point shall have at rest.

    Attributes:
        place: A point of the scene, or `node_<layer>_<i>_<j>`.
        axis: x, y or z.
        value: Coordinate in ldcs_base [m].
        weight: Weight of its distance beside those of the others.
    """

    place: str
    axis: str
    value: float
    weight: float = 1.0

    @property
    def name(self) -> str:
        """Its name, such as P1.z."""
        return f"{self.place}.{self.axis}"


@dataclass(frozen=True)
class Variable:
    """A command that may vary.

    Attributes:
        name: `pressure.left`, `torque.left`, `torque.left_joint_2`, `wrench.P1.force.z`.
        low: Its smallest value [Pa, N m or N].
        high: Its largest value.
        slew: Its fastest change, in a course [Pa/s, N m/s or N/s].
    """

    name: str
    low: float
    high: float
    slew: float = math.inf


@dataclass(frozen=True)
class Reached:
    """A solution.

    Attributes:
        commands: Value of each variable, by name [Pa, N m or N].
        reached: Coordinate at rest of each target, by name [m].
        distance: Square root of the weighted sum of squares of what remains [m]; of a shape alone, the RMS.
        optimality: Largest slope of the distance that a command within its bounds could still go down, over its
            range [m]. Near 0 there is no better point near, also where the target is out of reach.
        at_bounds: Variables that their bounds hold.
        sensitivity: Derivative of the targets' coordinates by the variables, shape (n_targets, n_variables).
        lowest_eigenvalue: The square of the lowest angular frequency [1/s^2]; negative on an unstable branch.
        stable: Whether the rest state is stable.
        steps: Gauss-Newton steps.
        coordinates: Coordinates of the rest state [m, rad].
        schedule: The commands as entries of a scene's `inputs` at its start, with those that did not vary.
        shape_error: Height of each node of a shape above it, by the order of `ShapeTarget.nodes` [m]; else empty.
        shape_rms: Weighted root mean square of it [m]; 0 without a shape.
    """

    commands: dict[str, float]
    reached: dict[str, float]
    distance: float
    optimality: float
    at_bounds: tuple[str, ...]
    sensitivity: np.ndarray
    lowest_eigenvalue: float
    stable: bool
    steps: int
    coordinates: np.ndarray = field(repr=False)
    schedule: Entries = field(repr=False)
    shape_error: np.ndarray = field(repr=False)
    shape_rms: float


def reach(
    simulation: Simulation,
    targets: Sequence[TargetCoordinate],
    variables: Sequence[Variable],
    *,
    shape: ShapeTarget | None = None,
    starts: int = 1,
    seed: int = 0,
) -> list[Reached]:
    """Return the solutions that were found, the nearest first.

    Gauss-Newton steps with a secant of the curvature and with bounds (an active-set method), shortened until the
    distance falls. Each is a solve of the full model to convergence.

    Args:
        simulation: The simulation; the branch of its present rest state is followed. It stays as it is.
        targets: Coordinates that shall be reached.
        variables: What may vary, and within which bounds.
        shape: Shape of the whole sheet that shall be reached; its RMS counts beside the targets.
        starts: Number of starting points: the present commands, brought within the bounds, then random ones.
        seed: Seed of the random ones.

    Raises:
        ValueError: There is no target or variable, a name is unknown, or bounds are in the wrong order.
        DivergenceError: The scene has no rest state at any starting point.
    """
    at = simulation.operating_point()
    present = np.array([command.present(at.held) for command in commands_of(at, variables)])
    draw = np.random.default_rng(seed)
    low, high = np.array([(variable.low, variable.high) for variable in variables]).T
    others = [draw.uniform(low, high) for _ in range(starts - 1)]
    with one_thread():
        return reach_from(at, targets, variables, shape, [present, *others])


def reach_from(
    at: OperatingPoint,
    targets: Sequence[TargetCoordinate],
    variables: Sequence[Variable],
    shape: ShapeTarget | None,
    starts: Sequence[np.ndarray],
) -> list[Reached]:
    """Return the solutions that searches from values of the variables find, shape (n_variables,), the nearest first.

    Raises:
        ValueError: As `reach`.
        DivergenceError: There is no rest state at any of them.
    """
    problem = _Problem(at, targets, variables, shape)
    found: list[Reached] = []
    failed: DivergenceError | None = None
    for values in starts:
        try:
            solution = problem.solve(problem.fractions(values))
        except DivergenceError as error:
            failed = error
            continue
        if not any(problem.same(solution, other) for other in found):
            found.append(solution)
    if not found:
        assert failed is not None
        raise failed
    return sorted(found, key=lambda one: one.distance)


def rest_course(
    at: OperatingPoint,
    targets: Sequence[TargetCoordinate],
    variables: Sequence[Variable],
    wanted: np.ndarray,
) -> np.ndarray:
    """Return values of the variables under which targets rest nearest to their values, one row after the other.

    Args:
        at: The state to begin at.
        targets: Coordinates; their own values are not used.
        variables: What may vary.
        wanted: Values of the coordinates [m], shape (n, n_targets); NaN where one is open.

    Returns:
        Shape (n, n_variables). Rows without a rest state near repeat the one before.
    """
    values = np.array([command.present(at.held) for command in commands_of(at, variables)])
    problem = _Problem(at, targets, variables, None)
    rows = []
    for row in wanted:
        problem.aim_at(row)
        with contextlib.suppress(DivergenceError):
            values = np.array(list(problem.solve(problem.fractions(values)).commands.values()))
        rows.append(values)
    return np.array(rows)


def commands_of(at: OperatingPoint, variables: Sequence[Variable]) -> list[CommandDirection]:
    """Return the command of each variable.

    Raises:
        ValueError: There is no variable, a name is unknown or means several commands, or bounds are in the wrong order.
    """
    commands = [one for variable in variables for one in command_directions(at, variable.name)]
    if not variables or len(commands) != len(variables):
        raise ValueError("expected at least one variable, each a single command")
    bad = [one for one in variables if not one.low < one.high]
    if bad:
        raise ValueError(
            f"{bad[0].name}: got {bad[0].low:g}..{bad[0].high:g}, expected the lower bound first"
        )
    return commands


class _Problem:
    def __init__(
        self,
        at: OperatingPoint,
        targets: Sequence[TargetCoordinate],
        variables: Sequence[Variable],
        shape: ShapeTarget | None,
    ) -> None:
        if not targets and shape is None:
            raise ValueError("expected at least one target or a shape")
        for one in targets:
            if one.axis not in AXES or not one.place:
                raise ValueError(f"got the target {one.name!r}, expected a point and an axis such as P1.z")
        numbers = [x for one in targets for x in (one.value, one.weight)]
        numbers += [x for one in variables for x in (one.low, one.high)]
        if not np.isfinite(numbers).all() or min((one.weight for one in targets), default=0.0) < 0.0:
            raise ValueError("expected finite values and bounds, and weights of 0 or above")
        self._places = [point_at(at.model.lattice, target.place, at.model.points) for target in targets]
        self._states = RestStates(at, commands_of(at, variables))
        self._targets, self._variables, self._shape = tuple(targets), tuple(variables), shape
        self._rows = np.array([3 * k + AXES.index(one.axis) for k, one in enumerate(targets)], dtype=int)
        self._wanted = np.array([target.value for target in targets])
        self._weight = np.array([target.weight for target in targets])
        self._low = np.array([variable.low for variable in variables])
        self._range = np.array([variable.high for variable in variables]) - self._low

    def aim_at(self, wanted: np.ndarray) -> None:
        """Take other values of the targets [m], shape (n_targets,); NaN where one is open."""
        self._wanted = np.where(np.isfinite(wanted), wanted, 0.0)
        self._weight = np.where(np.isfinite(wanted), [target.weight for target in self._targets], 0.0)

    def fractions(self, values: np.ndarray) -> np.ndarray:
        """Return values of the variables as fractions of their ranges, within the bounds, shape (n_variables,)."""
        return np.array(np.clip((values - self._low) / self._range, 0.0, 1.0))

    def _coordinates(self, flat: np.ndarray) -> np.ndarray:
        """Return the targets' coordinates, or their changes, from those of the whole model, shape (n_targets,)."""
        return positions(self._places, flat)[self._rows] if self._targets else np.empty(0)

    def _coordinate_slopes(self) -> np.ndarray:
        """Return the derivatives of the targets' coordinates by the commands, shape (n_targets, n_variables)."""
        return np.stack([self._coordinates(move) for move in self._states.moves.T], axis=1)

    def _residual(self) -> np.ndarray:
        q = self._states.q
        residual = self._weight * (self._coordinates(q) - self._wanted)
        return residual if self._shape is None else np.concatenate([residual, self._shape.residual(q)])

    def _slope(self) -> np.ndarray:
        slope = self._weight[:, None] * self._coordinate_slopes()
        if self._shape is not None:
            slope = np.vstack([slope, self._shape.slope(self._states.q, self._states.moves)])
        return np.array(slope * self._range)

    def solve(self, fraction: np.ndarray) -> Reached:
        """Go down from fractions of the ranges, shape (n_variables,)."""
        states = self._states
        states.go_to(self._low + fraction * self._range)
        residual, slope = self._residual(), self._slope()
        steps, still = 0, np.zeros((len(fraction), len(fraction)))
        curvature, falls = still, True
        while steps < MOST_STEPS:
            steps += 1
            if self._optimality(residual, slope, fraction) < OPTIMAL:
                break
            used = still if falls else curvature
            move = _bounded_step(slope, residual, used, -fraction, 1.0 - fraction)
            if not self._shorten(fraction, move, residual, slope):
                if not used.any():
                    break
                curvature = still
                continue
            before, residual_before, slope_before = fraction, residual, slope
            fraction = self.fractions(states.values)
            residual, slope = self._residual(), self._slope()
            bent = (slope - slope_before).T @ residual
            change = slope.T @ residual - slope_before.T @ residual_before
            curvature = _updated(curvature, fraction - before, bent, change)
            falls = float(residual @ residual) < FALL**2 * float(residual_before @ residual_before)
        return self._result(fraction, residual, slope, steps)

    def _shorten(
        self, fraction: np.ndarray, move: np.ndarray, residual: np.ndarray, slope: np.ndarray
    ) -> bool:
        """Take the longest part of a move that lowers the distance; False where none does."""
        states, before = self._states, float(residual @ residual)
        expected = float(residual @ (slope @ move))
        scale = 1.0
        while scale > 1e-6:
            values = self._low + np.clip(fraction + scale * move, 0.0, 1.0) * self._range
            try:
                states.go_to(values)
            except DivergenceError:
                scale *= 0.25
                continue
            now = self._residual()
            if float(now @ now) <= before + 1e-4 * scale * expected:
                return True
            scale *= 0.5
        states.go_to(self._low + fraction * self._range)
        return False

    def _optimality(self, residual: np.ndarray, slope: np.ndarray, fraction: np.ndarray) -> float:
        distance = float(np.linalg.norm(residual))
        if distance == 0.0:
            return 0.0
        down = -(slope.T @ residual) / distance
        held = ((fraction <= 0.0) & (down < 0.0)) | ((fraction >= 1.0) & (down > 0.0))
        # A distance that is as short itself is reached, whatever its slope.
        return float(min(np.abs(np.where(held, 0.0, down)).max(), distance))

    def _result(self, fraction: np.ndarray, residual: np.ndarray, slope: np.ndarray, steps: int) -> Reached:
        states = self._states
        names = [variable.name for variable in self._variables]
        held = [name for name, at in zip(names, fraction, strict=True) if at <= 0.0 or at >= 1.0]
        position, stability = self._coordinates(states.q), states.stability()
        return Reached(
            dict(zip(names, states.values.tolist(), strict=True)),
            {target.name: float(x) for target, x in zip(self._targets, position, strict=True)},
            float(np.linalg.norm(residual)),
            self._optimality(residual, slope, fraction),
            tuple(held),
            self._coordinate_slopes(),
            stability.eigenvalue,
            stability.is_stable,
            steps,
            states.q.copy(),
            entries(0.0, states.held(states.values)),
            np.empty(0) if self._shape is None else self._shape.error(states.q),
            0.0 if self._shape is None else float(np.linalg.norm(self._shape.residual(states.q))),
        )

    def same(self, one: Reached, other: Reached) -> bool:
        """Return whether two solutions are one."""
        a, b = (np.array(list(solution.commands.values())) for solution in (one, other))
        return bool(np.all(np.abs(a - b) <= SAME * self._range))


def _bounded_step(
    slope: np.ndarray, residual: np.ndarray, curvature: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the step x within bounds that minimises |residual + slope x|^2 + x curvature x."""
    gram = slope.T @ slope
    values, vectors = np.linalg.eigh(gram + curvature)
    if values[0] < -ROUNDING * values[-1]:
        # Bent downwards there is no least value.
        values, vectors = np.linalg.eigh(gram)
    kept = values > ROUNDING * values.max()
    root, along = np.sqrt(values[kept]), vectors[:, kept].T
    right = -(along @ (slope.T @ residual)) / root
    return np.asarray(lsq_linear(root[:, None] * along, right, (low - 1e-15, high + 1e-15), method="bvls").x)


def _updated(curvature: np.ndarray, step: np.ndarray, bent: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the sum of residuals times their second derivatives after a step, from its secant.

    Where targets stay out of reach, steps without it converge slowly. Update and scale are those of Dennis, Gay and
    Welsch (1981, An adaptive nonlinear least-squares algorithm, eq. 3.2 and 3.6).

    Args:
        curvature: Before, shape (n, n).
        step: Change of the commands, shape (n,).
        bent: Change of the slopes, times the residual at the end: what curvature times step shall be.
        change: Change of the gradient.
    """
    along = float(step @ change)
    if not along > 0.0:
        return np.zeros_like(curvature)
    own = float(step @ curvature @ step)
    scaled = curvature * (min(1.0, abs(float(step @ bent) / own)) if own != 0.0 else 1.0)
    missing = bent - scaled @ step
    outer = np.outer(missing, change) / along
    return scaled + outer + outer.T - float(missing @ step) / along**2 * np.outer(change, change)

"""Modal exponential steps for linear scenes (law `axiswise`): exact while loads and drives are polynomials of time."""

from __future__ import annotations

from collections import OrderedDict
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.linalg import eigh

from ldcs_ros.errors import SolverError
from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion

# Lobatto's points of a step, where loads and drives are sampled: a polynomial of degree 4 is followed exactly.
SAMPLES = np.array([0.0, 0.5 - np.sqrt(21.0) / 14.0, 0.5, 0.5 + np.sqrt(21.0) / 14.0, 1.0])
DEGREE = len(SAMPLES) - 1
TO_POWERS = np.linalg.inv(np.vander(SAMPLES, increasing=True))
# Without its middle sample the step is followed by a cubic: the difference estimates the error.
_CUBIC = np.linalg.inv(np.vander(SAMPLES[[0, 1, 3, 4]], increasing=True))
TO_DIFFERENCE = TO_POWERS.copy()
TO_DIFFERENCE[np.ix_(range(DEGREE), [0, 1, 3, 4])] -= _CUBIC
LINEAR_EFFECTS = ("springs", "gravity", "clamp", "driven_edges", "force", "payload")
MOST_MODES = 6000  # of one axis: the eigenvectors are dense
PROPORTIONAL = 1e-8
MOST_KEPT = 8
# Taylor's series to this degree is exact to rounding for matrices of this norm.
TAYLOR_TERMS, LARGEST_NORM = 13, 0.5


class Axis(NamedTuple):
    """The modes of one axis: x = shapes y, with y'' + damping y' + stiffness y = shapes^T f.

    Attributes:
        places: Which free coordinates, shape (n,).
        shapes: Mode shapes, normalised by mass, shape (n, n).
        damping: Of each mode [1/s], shape (n,).
        stiffness: Of each mode [1/s^2], shape (n,).
    """

    places: np.ndarray
    shapes: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


class Exponential(Integrator):
    """(y, y')(t + h) by the exact flow of each mode, driven by the interpolation polynomial of f through SAMPLES.

    Stable at any step for a damped model; with constant loads there is no error at all. The order of what is left,
    the interpolation of drives that are no polynomials, is DEGREE + 1 where damping is stiff and more where it is not.

    Raises:
        SolverError: The scene is not linear, its damping is not proportional, or it has too many nodes.
    """

    name: ClassVar[str] = "exponential"
    order: ClassVar[int] = DEGREE + 1
    error_order: ClassVar[int] = DEGREE + 1

    def __post_init__(self) -> None:
        super().__post_init__()
        self._refuse_nonlinear(self.model)
        self._axes: list[Axis] | None = None
        self._flows: OrderedDict[float, list[np.ndarray]] = OrderedDict()

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        model, free = self.model, self.model.free
        if self._axes is None:
            self._axes = self._modes(motion, inputs)
        flows = self._flow(h)
        pushes = np.empty((len(SAMPLES), len(free)))
        q, u = motion.q.copy(), motion.u.copy()
        # f = g(t) - K (q - q0) - C u: with the free coordinates held at (q0, 0) what is left is g.
        u[free] = 0.0
        for j, share in enumerate(SAMPLES):
            time = motion.time + share * h
            model.prescribe(time, q, u)
            pushes[j] = model.force(time, q, u, inputs)
        powers, difference = TO_POWERS @ pushes, TO_DIFFERENCE @ pushes
        moved, rate, defect = np.zeros(len(free)), np.zeros(len(free)), np.zeros(len(free))
        for axis, flow in zip(self._axes, flows, strict=True):
            y = np.zeros((DEGREE + 3, len(axis.places)))
            y[1] = h * (axis.shapes.T @ (model.mass[axis.places] * motion.u[free][axis.places]))
            y[2:] = h * h * powers[:, axis.places] @ axis.shapes
            result = np.einsum("mij,jm->im", flow, y)
            missed = np.einsum("mj,jm->m", flow[:, 0, 2:], h * h * difference[:, axis.places] @ axis.shapes)
            moved[axis.places], rate[axis.places] = axis.shapes @ result[0], axis.shapes @ result[1] / h
            defect[axis.places] = axis.shapes @ missed
        end = motion.time + h
        q[free] += moved
        u[free] = rate
        model.prescribe(end, q, u)
        a = model.accelerate(end, q, u, inputs)
        self.counters.evaluations += len(SAMPLES) + 1
        error = self.largest_displacement(defect)
        if not np.isfinite(error):
            raise StepFailure("the step left the finite numbers")
        self.counters.steps += 1
        return Step(motion, Motion(end, q, u, a), error)

    def _flow(self, h: float) -> list[np.ndarray]:
        """Return exp of each mode's matrix for (y, h y', f_0 ... f_d) over a step, shapes (n, 2, d + 3) [-]."""
        if h in self._flows:
            self._flows.move_to_end(h)
            return self._flows[h]
        flows: list[np.ndarray] = []
        axes = self._axes or []
        for index, axis in enumerate(axes):
            twin = next((k for k in range(index) if axes[k].shapes is axis.shapes), None)
            flows.append(
                _mode_flows(axis.stiffness * h * h, axis.damping * h) if twin is None else flows[twin]
            )
        self._flows[h] = flows
        if len(self._flows) > MOST_KEPT:
            self._flows.popitem(last=False)
        return flows

    def _modes(self, motion: Motion, inputs: HeldCommands) -> list[Axis]:
        model, n = self.model, len(self.model.free)
        values = model.jacobian(motion.time, motion.q, motion.u, inputs, positive_definite=False)
        rows, columns = model.jacobian_pattern
        used = (rows >= 0) & (columns >= 0)
        axes: list[Axis] = []
        for direction in range(3):
            places = np.flatnonzero(model.free % 3 == direction)
            place = np.full(n, -1)
            place[places] = np.arange(len(places))
            here = used & (place[rows] >= 0) & (place[columns] >= 0)
            stiffness, damping = np.zeros((len(places),) * 2), np.zeros((len(places),) * 2)
            for matrix, value in zip((stiffness, damping), values, strict=True):
                np.add.at(matrix, (place[rows[here]], place[columns[here]]), -value[here])
            same = next((axis for axis in axes if self._same_nodes(axis.places, places)), None)
            # The law is the same for all axes; one decomposition serves those with the same free nodes.
            axes.append(
                same._replace(places=places)
                if same
                else self._axis(places, stiffness, damping, model.mass[places])
            )
        self.counters.factorisations += 1
        return axes

    def _same_nodes(self, one: np.ndarray, other: np.ndarray) -> bool:
        return np.array_equal(self.model.free[one] // 3, self.model.free[other] // 3)

    def _axis(self, places: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray) -> Axis:
        if len(places) > MOST_MODES:
            raise SolverError(
                f"integrator 'exponential' keeps dense modes of at most {MOST_MODES} nodes, got {len(places)}; "
                f"use 'integrator: auto' @ solver.integrator"
            )
        root = np.sqrt(mass)
        squares, shapes = eigh(stiffness / np.outer(root, root))
        shapes /= root[:, None]
        modal = shapes.T @ damping @ shapes
        own = np.diag(modal).copy()
        if np.abs(modal - np.diag(own)).max(initial=0.0) > PROPORTIONAL * np.abs(own).max(initial=1e-300):
            raise SolverError(
                "integrator 'exponential' needs damping in proportion to stiffness; use 'integrator: auto' "
                "@ solver.integrator"
            )
        return Axis(places, shapes, own, squares)

    @staticmethod
    def _refuse_nonlinear(model: Model) -> None:
        for effect in model.effects:
            if effect.name not in LINEAR_EFFECTS or getattr(effect, "law", "axiswise") != "axiswise":
                law = f" with law '{effect.law}'" if hasattr(effect, "law") else ""
                raise SolverError(
                    f"integrator 'exponential' solves linear scenes only, but the effect '{effect.name}'{law} is not "
                    f"linear; use springs with law 'axiswise' and effects out of {list(LINEAR_EFFECTS)}, or "
                    f"'integrator: auto' @ solver.integrator"
                )


def _mode_flows(stiffness: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Return the flows of y'' = -damping y' - stiffness y + sum f_j s^j from s = 0 to 1, shape (n, 2, d + 3)."""
    size = DEGREE + 3
    matrices = np.zeros((len(stiffness), size, size))
    matrices[:, 0, 1] = 1.0
    matrices[:, 1, 0], matrices[:, 1, 1], matrices[:, 1, 2] = -stiffness, -damping, 1.0
    # z_j = s^j / j!: z_0 drives y', each feeds the one before it.
    for j in range(2, size - 1):
        matrices[:, j, j + 1] = 1.0
    flows = _exponentials(matrices)[:, :2]
    flows[:, :, 2:] *= np.cumprod([1.0, *range(1, DEGREE + 1)])
    return flows


def _exponentials(matrices: np.ndarray) -> np.ndarray:
    """Return exp of each matrix, shape (n, m, m), by scaling and squaring, all matrices at once."""
    norm = np.abs(matrices).sum(axis=2).max(axis=1)
    squarings = np.maximum(0, np.ceil(np.log2(np.maximum(norm, 1e-300) / LARGEST_NORM))).astype(int)
    small = matrices * (0.5**squarings)[:, None, None]
    unit = np.broadcast_to(np.eye(matrices.shape[1]), matrices.shape)
    result = unit.copy()
    for j in range(TAYLOR_TERMS, 0, -1):
        result = unit + small @ result / j
    for k in range(int(squarings.max(initial=0))):
        again = squarings > k
        result[again] = result[again] @ result[again]
    return result

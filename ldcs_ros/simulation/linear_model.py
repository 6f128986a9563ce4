"""The linear model of a simulation around its present state: matrices with names, natural modes."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse
from scipy.sparse import linalg as sparse_linalg

from ldcs_ros import extras
from ldcs_ros.errors import SolverError
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.simulation.command_directions import (
    AXES,
    OperatingPoint,
    all_commands,
    command_directions,
    force_slope,
)

if TYPE_CHECKING:
    from scipy.signal import StateSpace

MOST_DENSE = 700
"""Free coordinates up to which all eigenvalues of dense matrices cost less than a search for one."""
FEWEST = 0.01
"""Part of them up to which a search by a dense Cholesky factor takes a third of the time, as measured."""
LEAST_PIVOT = 1e-15
"""A pivot below this fraction of the largest one is rounding: doubles have 1.1e-16, stiff couplings reach 1e-12."""
LEAST_SEARCHED = 6
"""Modes that a search finds at least: the nearest to its shift are not always the lowest."""


@dataclass(frozen=True)
class LinearModel:
    """dx/dt = A x + B u, y = C x around a state; x, u and y are differences from it.

    Attributes:
        A: Shape (n_states, n_states); the states are the free coordinates, then their rates.
        B: Shape (n_states, n_inputs).
        C: Shape (n_outputs, n_states).
        state_names: `node_top_8_4.x` and `left_link_2`, then the same with `rate of` [m, rad; m/s, rad/s].
        input_names: `pressure.left` [Pa], `torque.left_joint_1` [N m], `wrench.P1.force.z` [N].
        output_names: x, y, z of each named point in ldcs_base [m].
        frequencies: Natural frequencies without damping [Hz], rising; negative for an unstable direction, which
            grows by `exp(2 pi |f| t)`.
        damping: Damping ratio of each mode by its own shape, shape (n_modes,).
        modes: Shape of each mode in all coordinates, shape (n_modes, n_coordinates); its largest displacement is 1 m.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    frequencies: np.ndarray
    damping: np.ndarray
    modes: np.ndarray

    @property
    def D(self) -> np.ndarray:  # noqa: N802  # as everywhere in control
        """Shape (n_outputs, n_inputs): no command moves a point at once."""
        return np.zeros((len(self.output_names), len(self.input_names)))

    def to_scipy(self) -> StateSpace:
        """Return a scipy.signal.StateSpace."""
        from scipy import signal

        return signal.StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> object:
        """Return a control.StateSpace with the names of states, inputs and outputs.

        Raises:
            MissingPackageError: The package `control` is not installed.
        """
        control = extras.load("control", extra="control", purpose="to_control")
        names = {"states": self.state_names, "inputs": self.input_names, "outputs": self.output_names}
        # A dot separates system and signal there.
        renamed = {kind: [name.replace(".", "_") for name in given] for kind, given in names.items()}
        return control.ss(self.A, self.B, self.C, self.D, **renamed)


def stiffness_and_damping(
    model: Model, time: float, q: np.ndarray, u: np.ndarray, held: HeldCommands
) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Return d(force)/dq and d(force)/du of the free coordinates, shape (n_free, n_free) each."""
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    size = len(model.free)
    by_q, by_u = (
        sparse.csc_matrix((values[used], (rows[used], columns[used])), shape=(size, size))
        for values in model.jacobian(time, q, u, held, positive_definite=False)
    )
    if model.wrench is not None and held.wrenches:
        # The model's own Jacobian serves iterations and leaves out how wrenches turn.
        rotating, slope = model.wrench.position_slope(q, held)
        place = np.full(model.n_coordinates, -1)
        place[model.free] = np.arange(size)
        used = place[rotating] >= 0
        added = sparse.lil_matrix((size, size))
        added[:, place[rotating[used]]] = slope[np.ix_(model.free, used)]
        by_q = (by_q + added).tocsc()
    if model.arms is not None and model.n_free_angles and not model.arms.used.all():
        by_q = (by_q - sparse.diags(_held_stiffness(model, q, by_q))).tocsc()
    return by_q, by_u


def _held_stiffness(model: Model, q: np.ndarray, by_q: sparse.csc_matrix) -> np.ndarray:
    # Of the coordinates of links that a shorter arm does not have, which stay 0: a frequency above those of all nodes.
    blocks = model.inertia(q)
    assert model.arms is not None and blocks is not None
    inertia = np.concatenate([np.diag(block) for block in blocks])
    nodes = model.n_free_nodes
    fastest = np.abs(by_q.diagonal()[:nodes] / model.mass).max(initial=1.0)
    held = np.zeros(len(model.free))
    held[nodes:] = np.where(model.arms.used.ravel(), 0.0, fastest * inertia)
    return held


def rest_factors(by_q: sparse.csc_matrix) -> sparse_linalg.SuperLU:
    """Return factors of df/dq at a rest state, which answer how the state moves with a force.

    Raises:
        SolverError: A motion meets no stiffness, so that commands do not determine the rest state.
    """
    try:
        factors = sparse_linalg.splu(by_q)
    except RuntimeError:  # SciPy's word for an exactly singular matrix
        factors = None
    if factors is not None:
        pivots = np.abs(factors.U.diagonal())
        if pivots.min() > LEAST_PIVOT * pivots.max():
            return factors
    raise SolverError(
        "the rest state is not determined: a motion of the sheet or of an arm meets no stiffness; "
        "expected springs, joints or supports that hold every node and link"
    )


def mass_matrix(model: Model, q: np.ndarray) -> sparse.csc_matrix:
    """Return the mass matrix of the free coordinates, shape (n_free, n_free)."""
    blocks = model.inertia(q)
    nodes = sparse.diags(model.mass)
    return sparse.block_diag([nodes, *(blocks if blocks is not None else [])], format="csc")


def natural_modes(
    model: Model, q: np.ndarray, by_q: sparse.csc_matrix, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenvalues of M^-1 times the symmetric stiffness [1/s^2], rising, and their shapes as columns.

    The mass matrix normalises the shapes, shape (n_free, count).
    """
    stiff, mass = -0.5 * (by_q + by_q.T), mass_matrix(model, q)
    size = len(model.free)
    count = min(count, size)
    if size <= MOST_DENSE:
        if count <= FEWEST * size:
            with contextlib.suppress(np.linalg.LinAlgError):
                # Positive definite: those nearest to 0 are the lowest.
                factor = linalg.cho_factor(stiff.toarray(), check_finite=False)
                inverse = sparse_linalg.LinearOperator(
                    (size, size), lambda right: linalg.cho_solve(factor, right)
                )
                return _sorted(
                    sparse_linalg.eigsh(stiff, count, mass, sigma=0.0, OPinv=inverse, v0=np.ones(size)), count
                )
        values, shapes = linalg.eigh(stiff.toarray(), mass.toarray(), subset_by_index=[0, count - 1])
        return values, shapes
    # A shift a little below zero is no eigenvalue of a free sheet, and finds the slowest motions.
    shift = -1e-6 * largest_eigenvalue(model, q, by_q)
    searched = max(count, LEAST_SEARCHED)
    return _sorted(sparse_linalg.eigsh(stiff, searched, mass, sigma=shift, v0=np.ones(size)), count)


def _sorted(found: tuple[np.ndarray, np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
    values, shapes = found
    lowest = np.argsort(values)[:count]
    return values[lowest], shapes[:, lowest]


def largest_eigenvalue(model: Model, q: np.ndarray, by_q: sparse.csc_matrix) -> float:
    """Return the largest eigenvalue of M^-1 times the stiffness [1/s^2], estimated by its diagonal.

    Shapes: q (n_coordinates,), by_q (n_free, n_free).
    """
    return float(np.max(np.abs(by_q.diagonal()) / mass_matrix(model, q).diagonal(), initial=0.0))


def linearize(at: OperatingPoint, modes: int = 12) -> LinearModel:
    """Return the linear model around a state.

    Args:
        at: The state. Around a motion the model holds for the moment.
        modes: Number of natural modes, the lowest ones.
    """
    model, time, q, u, held = at.model, at.time, at.q, at.u, at.now
    by_q, by_u = stiffness_and_damping(model, time, q, u, held)
    size = len(model.free)
    mass = mass_matrix(model, q)
    inverse = sparse_linalg.splu(mass)
    acceleration = inverse.solve(model.force(time, q, u, held))
    position = by_q.toarray() - _inertia_slope(model, q, acceleration)
    a = np.zeros((2 * size, 2 * size))
    a[:size, size:] = np.eye(size)
    a[size:, :size], a[size:, size:] = inverse.solve(position), inverse.solve(by_u.toarray())
    inputs = [one for name in all_commands(at) for one in command_directions(at, name)]
    b = np.zeros((2 * size, len(inputs)))
    for column, one in enumerate(inputs):
        b[size:, column] = inverse.solve(force_slope(model, time, q, u, held, one))
    points = model.points
    c = np.zeros((3 * len(points), 2 * size))
    for row, point in enumerate(points.values()):
        for axis in range(3):
            weights = np.zeros(model.n_coordinates)
            weights[3 * point.nodes + axis] = point.fraction
            c[3 * row + axis, :size] = weights[model.free]
    values, shapes = natural_modes(model, q, by_q, modes)
    # Of shapes that the mass matrix normalises, 2 zeta omega is the damper's power at unit rate.
    power = np.einsum("ik,ik->k", shapes, -(by_u @ shapes))
    omega = np.sign(values) * np.sqrt(np.abs(values))
    names = [_state_name(model, int(coordinate)) for coordinate in model.free]
    return LinearModel(
        a,
        b,
        c,
        (*names, *(f"rate of {name}" for name in names)),
        tuple(one.name for one in inputs),
        tuple(f"{name}.{axis}" for name in points for axis in AXES),
        omega / (2.0 * np.pi),
        0.5 * power / np.maximum(np.abs(omega), 1e-12),
        np.array([_scaled(model, shape) for shape in shapes.T]),
    )


def _inertia_slope(model: Model, q: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return d(M a)/dq at a fixed acceleration, shape (n_free, n_free); only the arms' inertia depends on angles."""
    slope = np.zeros((len(model.free), len(model.free)))
    step = 1e-6
    for column in range(model.n_free_nodes, len(model.free)):
        ahead, before = q.copy(), q.copy()
        ahead[model.free[column]] += step
        before[model.free[column]] -= step
        slope[:, column] = (model.momentum(ahead, acceleration) - model.momentum(before, acceleration)) / (
            2 * step
        )
    return slope


def _state_name(model: Model, coordinate: int) -> str:
    name = model.coordinate_name(coordinate)
    return (
        f"{name}.{AXES[coordinate % 3]}" if coordinate < 3 * model.lattice.n_nodes else name.replace(" ", "_")
    )


def _scaled(model: Model, shape: np.ndarray) -> np.ndarray:
    whole = np.zeros(model.n_coordinates)
    whole[model.free] = shape
    nodes = whole[: 3 * model.lattice.n_nodes].reshape(-1, 3)
    return whole / max(float(np.linalg.norm(nodes, axis=1).max()), 1e-300)

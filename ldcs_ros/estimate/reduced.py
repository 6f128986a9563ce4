"""ReducedModel: the sheet's own forces, projected on a few modes; small enough for a filter in real time."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from ldcs_ros.errors import DivergenceError
from ldcs_ros.estimate.basis import GRAVITY, equilibria, main_directions
from ldcs_ros.physics.inputs import ChamberPressure, HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.scene import Scene
from ldcs_ros.simulation.threads import one_thread

PARAMETERS = ("gain", "load", "stiffness")
"""Factor on the arms' torque, weight at the loaded point beside the scene's [N], factor on the springs."""
NOMINAL = np.array([1.0, 0.0, 1.0])
_GAMMA = 1.0 + np.sqrt(0.5)  # L-stable
# The search for an equilibrium: iterations, and the change of a mode [m, rad over all coordinates] in one of them.
# Steps of 0.05, 0.1, 0.2 and 0.8 took 27 to 87, 12 to 32, 9 to 21 and 7 to 13 iterations with three arms.
_MOST_ITERATIONS, _LONGEST_MOVE = 200, 0.2
Slopes = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Derivatives of the reduced force by coordinates, by rates and by parameters."""


class ReducedModel:
    """M(theta) a'' = B f(q, q', pressure, theta) with q = mean + B^T a: a Galerkin projection of a scene's model.

    The forces are those of the full model, evaluated on all nodes. So equilibria and large motions are right up to
    the part that the modes omit. Only the matrix to solve and the filter's covariance are small.

    Args:
        scene: A scene whose arms are driven by pressure.
        point: Point that carries the unknown load.
        modes: Number of modes.
        basis: Mean shape and main directions, as `main_directions` returns them; None to compute them.

    Attributes:
        n: Number of modes.
        model: The full model.
        drive: Reduced force for one pascal in each arm [N/Pa], shape (n, n_arms).
    """

    def __init__(
        self,
        scene: Scene,
        point: str,
        *,
        modes: int = 24,
        basis: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        self.simulation = scene.build()
        self.model: Model = self.simulation.model
        if basis is None:
            with one_thread():
                basis = main_directions(equilibria(scene, point), modes)
        mean, directions = basis
        self.n = len(directions)
        free = self.model.free
        self._mean = mean
        self._directions = directions
        # Directions are orthonormal in all coordinates; prescribed ones do not move.
        self._basis = np.ascontiguousarray(directions[:, free])
        self._still = np.zeros(len(mean))
        self._lay_out()
        self._springs = next((term for term in self.model.terms if term.name == "springs"), None)
        carrier = self.simulation.points[point]
        nodes = carrier.nodes
        weight = np.zeros(len(mean))
        weight[3 * nodes + 2] = -carrier.fraction
        self._weight = self._basis @ weight[free]
        carried = np.zeros((3, len(mean)))
        for axis in range(3):
            carried[axis, 3 * nodes + axis] = carrier.fraction
        carried_basis = self._basis @ carried[:, free].T
        self._carried_mass = carried_basis @ carried_basis.T / GRAVITY
        self._mass = np.array([self._basis @ self.model.momentum(mean, row) for row in self._basis])
        n_arms = len(self.simulation.arm_names)
        self._no_pressure = self._held(np.zeros(n_arms))
        vented = self.model.force(0.0, mean, self._still, self._no_pressure)
        forces = [self.model.force(0.0, mean, self._still, self._held(unit)) for unit in np.eye(n_arms)]
        self.drive = np.stack([self._basis @ (force - vented) for force in forces], axis=1)

    def coordinates(self, a: np.ndarray) -> np.ndarray:
        """Return all coordinates [m, rad] of reduced ones, shape (n_coordinates,)."""
        return np.array(self._mean + a @ self._directions)

    def position(self, a: np.ndarray) -> np.ndarray:
        """Return node positions in ldcs_base [m], shape (n_nodes, 3)."""
        return self.coordinates(a)[: 3 * self.model.lattice.n_nodes].reshape(-1, 3)

    def velocity(self, v: np.ndarray) -> np.ndarray:
        """Return node velocities [m/s], shape (n_nodes, 3)."""
        return np.array((v @ self._directions)[: 3 * self.model.lattice.n_nodes]).reshape(-1, 3)

    def place(self, point: str) -> tuple[np.ndarray, np.ndarray]:
        """Return offset, shape (3,), and matrix, shape (3, n), of a point's position in reduced coordinates [m]."""
        stencil, count = self.simulation.points[point].stencil, 3 * self.model.lattice.n_nodes
        directions = self._directions[:, :count].reshape(self.n, -1, 3)
        matrix = np.stack([stencil.mean(direction) for direction in directions], axis=1)
        return stencil.mean(self._mean[:count].reshape(-1, 3)), matrix

    def mass(self, theta: np.ndarray) -> np.ndarray:
        """Return the reduced mass matrix under parameters, shape (n, n)."""
        return np.array(self._mass + max(theta[1], 0.0) * self._carried_mass)

    def force(self, a: np.ndarray, v: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the reduced force, shape (n,), at gauge pressures [Pa], shape (n_arms,)."""
        q, u = self.coordinates(a), v @ self._directions
        total = self._basis @ self.model.force(0.0, q, u, self._held(theta[0] * pressure))
        total += theta[1] * self._weight
        if theta[2] != 1.0:
            total += (theta[2] - 1.0) * self._elastic(q)
        return np.array(total)

    def slopes(self, a: np.ndarray, v: np.ndarray, pressure: np.ndarray, theta: np.ndarray) -> Slopes:
        """Return d(force)/da, d(force)/dv, each (n, n), and d(force)/dtheta, shape (n, 3)."""
        q, u = self.coordinates(a), v @ self._directions
        values = self.model.jacobian(0.0, q, u, self._held(theta[0] * pressure), positive_definite=False)
        by_a, by_v = (self._project(value) for value in values)
        by_theta = np.stack([self.drive @ pressure, self._weight, self._elastic(q)], axis=1)
        return by_a, by_v, by_theta

    def step(
        self, a: np.ndarray, v: np.ndarray, pressure: np.ndarray, theta: np.ndarray, h: float, slopes: Slopes
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a and v, shape (n,) each, a time h [s] later by the Rosenbrock method ROS2.

        Its order is 2, and it is L-stable (Verwer and others 1999).
        """
        mass, (by_a, by_v, _) = self.mass(theta), slopes
        g = _GAMMA * h
        matrix = mass - g * by_v - g * g * by_a

        def stage(
            a: np.ndarray, v: np.ndarray, less_a: np.ndarray, less_v: np.ndarray
        ) -> tuple[np.ndarray, np.ndarray]:
            # (I - g J) k = F - less, with the rows of a eliminated.
            force_a, force_v = v - less_a, self.force(a, v, pressure, theta) - mass @ less_v
            k_v = np.linalg.solve(matrix, force_v + g * (by_a @ force_a))
            return force_a + g * k_v, k_v

        zero = np.zeros_like(a)
        k1_a, k1_v = stage(a, v, zero, zero)
        k2_a, k2_v = stage(a + h * k1_a, v + h * k1_v, 2.0 * k1_a, 2.0 * k1_v)
        return a + h * (1.5 * k1_a + 0.5 * k2_a), v + h * (1.5 * k1_v + 0.5 * k2_v)

    def equilibrium(self, pressure: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return reduced coordinates of the equilibrium under gauge pressures [Pa] and parameters, shape (n,).

        Raises:
            DivergenceError: Newton's method found none.
        """
        a, v = np.zeros(self.n), np.zeros(self.n)
        for _ in range(_MOST_ITERATIONS):
            by_a, _, _ = self.slopes(a, v, pressure, theta)
            move = np.linalg.solve(-by_a, self.force(a, v, pressure, theta))
            a = a + move * min(1.0, _LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
            if np.abs(move).max() < 1e-9:
                return a
        raise DivergenceError(
            f"the modes have no equilibrium at pressures {np.array2string(pressure, precision=0)} Pa; "
            "check stiffness and loads of the scene"
        )

    def _elastic(self, q: np.ndarray) -> np.ndarray:
        if self._springs is None:
            return np.zeros(self.n)
        force = np.zeros(len(q))
        self._springs.add_force(0.0, q, self._still, self._no_pressure, force)
        return np.array(self._basis @ force[self.model.free])

    def _project(self, values: np.ndarray) -> np.ndarray:
        """Return B J B^T, shape (n, n), of Jacobian values at the model's `jacobian_pattern`."""
        data = np.bincount(self._slot, values[self._used], minlength=len(self._columns))
        size = len(self.model.free)
        matrix = csr_array((data, self._columns, self._row_starts), shape=(size, size))
        return np.array(self._basis @ (matrix @ self._basis_columns))

    def _lay_out(self) -> None:
        # The pattern of the Jacobian never changes: sort it once.
        rows, columns = self.model.jacobian_pattern
        self._used = np.flatnonzero((rows >= 0) & (columns >= 0))
        size = len(self.model.free)
        place, self._slot = np.unique(rows[self._used] * size + columns[self._used], return_inverse=True)
        self._columns = place % size
        self._row_starts = np.searchsorted(place, size * np.arange(size + 1))
        self._basis_columns = np.ascontiguousarray(self._basis.T)

    def _held(self, pressure: np.ndarray) -> HeldCommands:
        arms = self.simulation.model.arms
        assert arms is not None
        chambers = tuple(
            ChamberPressure(0.0, float(p), float(p), own.fill_time, own.vent_time)
            for p, own in zip(pressure, arms.each, strict=True)
        )
        return HeldCommands(chambers=chambers)

"""The model as a first-order system y' = F(t, y) with a sparse analytic Jacobian, for SciPy's solvers."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion


class FirstOrder:
    """y = (q, u) of the free coordinates; counts what is asked of it.

    Args:
        model: The model.
        motion: Where it starts; prescribed coordinates follow their own course.
        inputs: What is commanded.
    """

    def __init__(self, model: Model, motion: Motion, inputs: HeldCommands) -> None:
        self.model, self.inputs, self.evaluations = model, inputs, 0
        self._n = len(model.free)
        self._q, self._u = motion.q.copy(), motion.u.copy()
        self.start = np.concatenate([motion.q[model.free], motion.u[model.free]])

    def place(self, time: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return all coordinates and rates, shape (n_coordinates,), at y, shape (2 n_free,), until the next call."""
        self._q[self.model.free], self._u[self.model.free] = y[: self._n], y[self._n :]
        self.model.prescribe(time, self._q, self._u)
        return self._q, self._u

    def slope(self, time: float, y: np.ndarray) -> np.ndarray:
        """Return F = (u, M^-1 f), shape (2 n_free,)."""
        self.evaluations += 1
        a = self.model.accelerate(time, *self.place(time, y), self.inputs)
        return np.concatenate([y[self._n :], a])

    def jacobian(self, time: float, y: np.ndarray) -> Any:
        """Return dF/dy as a sparse matrix, shape (2 n_free, 2 n_free); the mass matrix counts as constant."""
        q, u = self.place(time, y)
        values = self.model.jacobian(time, q, u, self.inputs, positive_definite=False)
        rows, columns = self.model.jacobian_pattern
        used = (rows >= 0) & (columns >= 0)
        shape, inverse = (self._n, self._n), self._inverse_mass(q)
        blocks = [
            inverse @ sparse.coo_matrix((value[used], (rows[used], columns[used])), shape=shape).tocsr()
            for value in values
        ]
        return sparse.bmat([[None, sparse.identity(self._n)], blocks], format="csc")

    def motion(self, time: float, y: np.ndarray) -> Motion:
        """Return the motion at a time and a y, shape (2 n_free,)."""
        q, u = self.place(time, y)
        return Motion(time, q.copy(), u.copy(), self.model.accelerate(time, q, u, self.inputs))

    def _inverse_mass(self, q: np.ndarray) -> Any:
        parts = [sparse.diags(1.0 / self.model.mass)]
        blocks = self.model.inertia(q)
        if blocks is not None:
            parts += [sparse.csr_matrix(np.linalg.inv(block)) for block in blocks]
        return sparse.block_diag(parts, format="csr")

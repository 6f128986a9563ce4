"""The symmetric linear systems of implicit steps: banded Cholesky for the lattice, bordered by the arms' angles."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, lapack

from ldcs_ros.physics.inputs import HeldInputs
from ldcs_ros.physics.model import Model


class Factors:
    """A factored matrix W = M - h C - h^2 K, with C = d(force)/du and K = d(force)/dq; `solve` applies W^-1.

    Attributes:
        rate_step: The h of the factored matrix [s].
    """

    def __init__(
        self,
        order: np.ndarray,
        n_nodes: int,
        band: np.ndarray,
        border: np.ndarray,
        corner: np.ndarray,
        rate_step: float,
    ) -> None:
        self.rate_step = rate_step
        self._order, self._n = order, n_nodes
        self._band, status = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if status != 0:
            raise np.linalg.LinAlgError("the matrix is not positive definite")
        self._border = border
        if corner.size:
            self._reach, _ = lapack.dpbtrs(self._band, border, lower=1)
            self._corner = cho_factor(corner - border.T @ self._reach, lower=True)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return W^-1 right for free coordinates, shape (n_free,)."""
        result = np.empty_like(right)
        nodes, _ = lapack.dpbtrs(self._band, right[self._order], lower=1)
        if len(right) > self._n:
            angles = cho_solve(self._corner, right[self._n :] - self._border.T @ nodes)
            nodes -= self._reach @ angles
            result[self._n :] = angles
        result[self._order] = nodes
        return result


class LinearSystem:
    """Where each Jacobian entry of a model goes in band, border and corner; made once for a model.

    Node coordinates are ordered slab by slab along the longer side, so the half-bandwidth is about 6 times
    the number of nodes along the shorter side. The matrix is made symmetric: an entry and its mirror share
    the mean.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        n = model.n_free_nodes
        rows, columns = model.entries
        self._order = self._slabs(model)
        place = np.empty(len(model.free) + 1, dtype=np.int64)
        place[self._order] = np.arange(n)
        place[n:-1] = np.arange(n, len(model.free))
        rows, columns = place[rows], place[columns]  # -1, a prescribed coordinate, is not used below
        used = (model.entries[0] >= 0) & (model.entries[1] >= 0)
        row, column = np.maximum(rows, columns), np.minimum(rows, columns)
        inner = used & (row < n)
        self._width = int(np.max(row[inner] - column[inner], initial=0)) + 1
        share = np.where(rows == columns, 1.0, 0.5)
        self._inner, self._inner_share = np.flatnonzero(inner), share[inner]
        self._inner_slot = (row - column + column * self._width)[inner]
        n_angles = model.n_free_angles
        edge = used & (row >= n) & (column < n)
        self._edge, self._edge_share = np.flatnonzero(edge), share[edge]
        self._edge_slot = ((row - n) + column * n_angles)[edge]
        corner = used & (column >= n)
        self._corner = np.flatnonzero(corner)
        self._corner_slot = ((rows - n) * n_angles + columns - n)[corner]

    @staticmethod
    def _slabs(model: Model) -> np.ndarray:
        nx, ny = model.lattice.nodes
        node, axis = np.divmod(model.free[: model.n_free_nodes], 3)
        layer, i, j = np.unravel_index(node, (2, nx, ny))
        return np.lexsort((axis, layer, j, i) if nx >= ny else (axis, layer, i, j))

    def factor(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldInputs, rate_step: float
    ) -> Factors:
        """Return the factored W at a motion; its exact Jacobian if that is definite, else the stable part.

        Raises:
            numpy.linalg.LinAlgError: Even the stable part is not positive definite or not finite.
        """
        try:
            return self._assemble(time, q, u, inputs, rate_step, definite=False)
        except np.linalg.LinAlgError:
            return self._assemble(time, q, u, inputs, rate_step, definite=True)

    def _assemble(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldInputs,
        rate_step: float,
        *,
        definite: bool,
    ) -> Factors:
        n, n_angles = self.model.n_free_nodes, self.model.n_free_angles
        by_position, by_rate = self.model.jacobian(time, q, u, inputs, definite=definite)
        values = -rate_step * (by_rate + rate_step * by_position)
        if not np.isfinite(values).all():
            raise np.linalg.LinAlgError("the Jacobian is not finite")
        band = np.bincount(
            self._inner_slot, values[self._inner] * self._inner_share, minlength=n * self._width
        )
        band = band[: n * self._width].reshape((self._width, n), order="F")
        band[0] += self.model.mass[self._order]
        border = np.bincount(self._edge_slot, values[self._edge] * self._edge_share, minlength=n * n_angles)
        corner = np.bincount(self._corner_slot, values[self._corner], minlength=n_angles**2).reshape(
            n_angles, n_angles
        )
        blocks = self.model.inertia(q)
        if blocks is not None:
            corner = 0.5 * (corner + corner.T)
            m = blocks.shape[1]
            for side, block in enumerate(blocks):
                corner[side * m : (side + 1) * m, side * m : (side + 1) * m] += block
        return Factors(self._order, n, band, border.reshape(n, n_angles), corner, rate_step)

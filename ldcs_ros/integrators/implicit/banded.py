"""Banded Cholesky factors of the nodes' matrix: for small lattices, and where numba is absent."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ldcs_ros.integrators.implicit.ordering import inverse_permutation, lower_triangle, sheet_places
from ldcs_ros.physics.model import Model


class Band:
    """A symmetric matrix in LAPACK's lower band storage, the nodes ordered slab by slab along the longer side.

    The half-bandwidth is about 6 times the number of nodes along the shorter side.

    Attributes:
        order: Free coordinate at each place of the matrix, shape (n,).
        dtype: Of the stored values.
    """

    def __init__(self, model: Model, rows: np.ndarray, columns: np.ndarray) -> None:
        """Args: rows, columns: the free node coordinates of each entry, shape (n_entries,)."""
        layer, i, j, axis = sheet_places(model)
        nx, ny = model.lattice.nodes
        self.order = np.lexsort((axis, layer, j, i) if nx >= ny else (axis, layer, i, j))
        self.dtype = np.dtype(np.float64)
        row, column = lower_triangle(inverse_permutation(self.order), rows, columns)
        self._width = int(np.max(row - column, initial=0)) + 1
        self.slots = row - column + column * self._width
        self.diagonal = np.arange(len(self.order)) * self._width
        self.size = len(self.order) * self._width

    def factor(self, values: np.ndarray) -> BandFactors:
        """Return the factors of a matrix with `values` at its slots, shape (size,).

        Raises:
            numpy.linalg.LinAlgError: It is not positive definite.
        """
        band = values.reshape((self._width, len(self.order)), order="F")
        factors, status = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if status != 0:
            raise np.linalg.LinAlgError("the matrix is not positive definite")
        return BandFactors(factors)


class BandFactors:
    """The factors; `solve` applies the inverse."""

    def __init__(self, factors: np.ndarray) -> None:
        self._factors = factors

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution for a right side in the matrix's order, shape (n,) or (n, k)."""
        solution: np.ndarray = lapack.dpbtrs(self._factors, right, lower=1)[0]
        return solution

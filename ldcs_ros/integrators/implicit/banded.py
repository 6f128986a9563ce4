"""Banded Cholesky factors of the nodes' matrix: for small lattices, and where numba is absent."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from ldcs_ros.integrators.implicit.ordering import inverse_permutation, lower_triangle, sheet_places
from ldcs_ros.physics.compiled import HAVE_NUMBA, compiled_fast
from ldcs_ros.physics.model import Model

# From so many right sides on, block form is faster than LAPACK's column by column (9 x 9 nodes, BLAS on one core).
MANY = 6


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
        # At least two, as the compiled solve takes two columns at a time.
        self._width = int(np.max(row - column, initial=1)) + 1
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
    """The factors; `solve` applies the inverse.

    Attributes:
        lower: Column j of L from its diagonal on, shape (n, width); entries beyond the matrix are zero.
        inverse_diagonal: Of L, shape (n,).
    """

    def __init__(self, factors: np.ndarray) -> None:
        self._factors, self.lower = factors, factors.T
        self.inverse_diagonal = 1.0 / factors[0]

    @cached_property
    def _blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """S_i^-1 of the Schur complements and G_i = L_i S_i^-1 of a block-tridiagonal form, single precision.

        Shapes (n_blocks, b, b) and (n_blocks - 1, b, b) with b the band's width; the last block is filled up.
        """
        width, n = self._factors.shape
        b = max(width - 1, 1)
        count = -(-n // b)
        band = np.zeros((width, (count + 1) * b), np.float32)
        band[:, :n] = self._factors
        band[0, n:] = 1.0
        down, across = np.indices((2 * b, b))
        inside = (down >= across) & (down - across < width)
        down, across = down[inside], across[inside]
        lower = np.zeros((count, 2 * b, b), np.float32)
        lower[:, down, across] = band[down - across, across + b * np.arange(count)[:, None]]
        root = np.stack([lapack.strtri(block[:b], lower=1)[0] for block in lower])
        return root.transpose(0, 2, 1) @ root, lower[:-1, b:] @ root[:-1]

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution for a right side in the matrix's order, shape (n,) or (n, k)."""
        if not HAVE_NUMBA:
            solution: np.ndarray = lapack.dpbtrs(self._factors, right, lower=1)[0]
            return solution
        columns = np.atleast_2d(right.T)
        result = np.empty(columns.shape)
        for column, solved in zip(columns, result, strict=True):
            solved[:] = column
            solve_band(self.lower, self.inverse_diagonal, solved)
        return result.T if right.ndim > 1 else result[0]

    def solve_columns(self, right: np.ndarray) -> np.ndarray:
        """Return the same for shape (n, k); many columns in single precision, by products of matrices."""
        if right.shape[1] < MANY:
            return self.solve(right)
        inverse, link = self._blocks
        # The scale keeps forces of any size within single precision.
        scale = np.abs(right).max(axis=0)
        scale[scale == 0.0] = 1.0
        x = np.zeros((inverse.shape[0] * inverse.shape[1], right.shape[1]), np.float32)
        np.divide(right, scale, out=x[: len(right)], casting="same_kind")
        x = x.reshape(*inverse.shape[:2], -1)
        for k in range(1, len(x)):
            x[k] -= link[k - 1] @ x[k - 1]
        x = inverse @ x
        for k in range(len(x) - 2, -1, -1):
            x[k] -= link[k].T @ x[k + 1]
        return np.asarray(x.reshape(-1, right.shape[1])[: len(right)] * scale)


@compiled_fast
def solve_band(lower, inverse_diagonal, x):  # type: ignore[no-untyped-def]
    """Replace a right side x, shape (n,), by the solution; half the time of LAPACK's dpbtrs at 9 x 9 nodes.

    Two columns at a time read and write x once for both. Near the end columns are as long as what is left.
    """
    n, width = lower.shape
    for j in range(0, n - 1, 2):
        near, far = lower[j], lower[j + 1]
        first = x[j] * inverse_diagonal[j]
        second = (x[j + 1] - first * near[1]) * inverse_diagonal[j + 1]
        x[j], x[j + 1] = first, second
        left = min(width, n - j)
        rest, near, far = x[j + 2 : j + left], near[2:left], far[1 : left - 1]
        for i in range(rest.size):
            rest[i] -= first * near[i] + second * far[i]
        if j + width < n:
            x[j + width] -= second * lower[j + 1, width - 1]
    if n % 2 == 1:
        x[n - 1] *= inverse_diagonal[n - 1] ** 2
    for j in range(n - 2 - n % 2, -1, -2):
        near, far = lower[j], lower[j + 1]
        left = min(width, n - j)
        rest, near, far = x[j + 2 : j + left], near[2:left], far[1 : left - 1]
        first = second = 0.0
        for i in range(rest.size):
            first += near[i] * rest[i]
            second += far[i] * rest[i]
        if j + width < n:
            second += lower[j + 1, width - 1] * x[j + width]
        x[j + 1] = (x[j + 1] - second) * inverse_diagonal[j + 1]
        x[j] = (x[j] - first - lower[j, 1] * x[j + 1]) * inverse_diagonal[j]

"""Block-tridiagonal factors with explicit inverses, for iterations in compiled code."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ldcs_ros.integrators.implicit.ordering import inverse_permutation, lower_triangle, sheet_places
from ldcs_ros.physics.compiled import compiled_fast
from ldcs_ros.physics.model import Model

# Rows of a block are filled up to a multiple of this, so that vector registers are full.
PADDING = 8


class BlockTridiagonal:
    """A symmetric matrix by slabs of nodes across the sheet's longer side; springs join neighbouring slabs only.

    Attributes:
        order: Free coordinate at each place of the matrix, shape (n,).
        dtype: Of the assembled values.

    Raises:
        ValueError: The slabs do not have the same number of free coordinates.
    """

    def __init__(self, model: Model, rows: np.ndarray, columns: np.ndarray) -> None:
        """Args: rows, columns: the free node coordinates of each entry, shape (n_entries,)."""
        layer, i, j, axis = sheet_places(model)
        nx, ny = model.lattice.nodes
        self.order = np.lexsort((axis, layer, j, i) if nx >= ny else (axis, layer, i, j))
        self.dtype = np.dtype(np.float64)
        slabs, counts = np.unique(i if nx >= ny else j, return_counts=True)
        self._n_slabs, self._block = len(slabs), int(counts[0])
        if (counts != self._block).any():
            raise ValueError(
                f"slabs of {counts.min()} to {counts.max()} free coordinates, expected equal ones"
            )
        row, column = lower_triangle(inverse_permutation(self.order), rows, columns)
        block = self._block
        if np.max(row // block - column // block, initial=0) > 1:
            raise ValueError("an entry joins slabs that are not neighbours")
        pair = 2 * (column // block) + (row // block - column // block)
        self.slots = (pair * block + row % block) * block + column % block
        place = np.arange(len(self.order))
        self.diagonal = (2 * (place // block) * block + place % block) * block + place % block
        self.size = 2 * self._n_slabs * block * block

    def factor(self, values: np.ndarray) -> BlockFactors:
        """Return the factors of a matrix with `values` at its slots, shape (size,).

        Raises:
            numpy.linalg.LinAlgError: It is not positive definite.
        """
        n, b = self._n_slabs, self._block
        blocks = values.reshape(n, 2, b, b)
        padded = PADDING * -(-b // PADDING)
        inverse, link = (
            np.zeros((n, padded, padded), np.float32),
            np.zeros((n - 1, padded, padded), np.float32),
        )
        schur = blocks[0, 0]
        for slab in range(n):
            # Row-major lower halves are LAPACK's upper ones.
            factor, status = lapack.dpotrf(schur.T, lower=0)
            if status != 0:
                raise np.linalg.LinAlgError("the matrix is not positive definite")
            half, _ = lapack.dpotri(factor, lower=0)
            full = np.triu(half) + np.triu(half, 1).T
            inverse[slab, :b, :b] = full
            if slab + 1 < n:
                below = blocks[slab, 1]
                step = below @ full
                link[slab, :b, :b] = step
                schur = blocks[slab + 1, 0] - step @ below.T
        return BlockFactors(inverse, link, b)


class BlockFactors:
    """S_i^-1 of the Schur complements and G_i = L_i S_i^-1 with the blocks L_i below the diagonal, single precision.

    Attributes:
        inverse: S_i^-1, shape (n_slabs, padded, padded).
        link: G_i, shape (n_slabs - 1, padded, padded).
        link_transposed: G_i^T, same shape.
        block: Coordinates of a slab; the padding after them is zero.
    """

    def __init__(self, inverse: np.ndarray, link: np.ndarray, block: int) -> None:
        self.inverse, self.link, self.block = inverse, link, block
        self.link_transposed = np.ascontiguousarray(link.transpose(0, 2, 1))
        self.room = np.zeros((2, *inverse.shape[:2]), np.float32)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution for a right side in the matrix's order, shape (n,) or (n, k)."""
        columns = np.atleast_2d(right.T)
        result = np.empty(columns.shape)
        for column, solution in zip(columns, result, strict=True):
            solution[:] = column
            solve_blocks(self.inverse, self.link, self.link_transposed, self.block, self.room, solution)
        return result.T if right.ndim > 1 else result[0]


@compiled_fast
def _subtract_product(transposed, x, y):  # type: ignore[no-untyped-def]
    # y -= A x, column by column: contiguous and without sums across a register.
    for c in range(x.size):
        row, factor = transposed[c], x[c]
        for r in range(y.size):
            y[r] -= row[r] * factor


@compiled_fast
def solve_blocks(inverse, link, link_transposed, block, room, x):  # type: ignore[no-untyped-def]
    """Replace a right side x by the solution, shape (n_slabs * block,); room has shape (2, n_slabs, padded)."""
    n = inverse.shape[0]
    # The scale keeps forces of any size within single precision.
    largest = 0.0
    for k in range(x.size):
        largest = max(largest, abs(x[k]))
    if not largest > 0.0:
        return
    near, far = room[0], room[1]
    for slab in range(n):
        for r in range(block):
            near[slab, r] = x[slab * block + r] / largest
    for slab in range(1, n):
        _subtract_product(link_transposed[slab - 1], near[slab - 1], near[slab])
    for slab in range(n):
        far[slab, :] = 0.0
        _subtract_product(inverse[slab], near[slab], far[slab])
    for slab in range(n - 2, -1, -1):
        # far holds minus the solution, and so does what is taken from it.
        _subtract_product(link[slab], far[slab + 1], far[slab])
    for slab in range(n):
        for r in range(block):
            x[slab * block + r] = -largest * far[slab, r]

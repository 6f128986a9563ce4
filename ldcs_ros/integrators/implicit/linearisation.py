"""The equation of motion linearised along a motion, and its implicit stages solved for many right sides at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import linalg as sparse_linalg

from ldcs_ros.integrators.implicit.system import Factors, scatter
from ldcs_ros.physics.compiled import HAVE_NUMBA, compiled
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model

# Directions of one search; kept factors of a step need three to six.
MOST_DIRECTIONS = 12
# Step of the differences of the arms' inertia, a cosine of angles [rad]: truncation and rounding are near 1e-11.
ANGLE_STEP = 1e-5


@dataclass(frozen=True)
class SparseMatrix:
    """A square matrix by rows, as of `scipy.sparse.csr_matrix`, for products with a few columns.

    Attributes:
        starts: First entry of each row, shape (n + 1,).
        columns: Column of each entry, shape (n_entries,).
        values: The entries.
    """

    starts: np.ndarray
    columns: np.ndarray
    values: np.ndarray

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        if not HAVE_NUMBA:
            return np.asarray(self.to_scipy() @ x)
        result = np.zeros(x.shape)
        _add_product(self.starts, self.columns, self.values, x, result)
        return result

    def to_scipy(self) -> sparse.csr_matrix:
        """Return the same as a scipy.sparse.csr_matrix."""
        n = len(self.starts) - 1
        return sparse.csr_matrix((self.values, self.columns, self.starts), shape=(n, n))


@compiled
def _add_product(starts, columns, values, x, result):  # type: ignore[no-untyped-def]
    for i in range(starts.size - 1):
        for entry in range(starts[i], starts[i + 1]):
            value, j = values[entry], columns[entry]
            for c in range(x.shape[1]):
                result[i, c] += value * x[j, c]


class Linearisation:
    """d(f - M a)/dq and df/du of the free coordinates at one instant, and the mass matrix, of one sparse pattern.

    Unlike `LinearSystem` it is exact: neither made symmetric nor positive definite.

    Args:
        model: The model.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        n, first = len(model.free), model.n_free_nodes
        rows, columns = model.jacobian_pattern
        self._used = np.flatnonzero((rows >= 0) & (columns >= 0))
        self._ones = np.ones(len(self._used))
        blocks = model.inertia(model.reference_state()[0])
        links = 0 if blocks is None else blocks.shape[1]
        angle = np.arange(n - first)
        same = (angle[:, None] // max(links, 1)) == (angle // max(links, 1))
        inner_row, inner_column = np.nonzero(same)
        keys = [
            rows[self._used] * n + columns[self._used],
            np.arange(n) * (n + 1),
            (first + inner_row) * n + first + inner_column,
        ]
        pattern, slot = np.unique(np.concatenate(keys), return_inverse=True)
        counts = np.cumsum([len(key) for key in keys])
        self._slot, self._diagonal, self._inner = np.split(slot.ravel(), counts[:-1])
        self._columns = (pattern % n).astype(np.int32)
        self._starts = np.searchsorted(pattern // n, np.arange(n + 1)).astype(np.int32)
        self._links = links

    def at(
        self, time: float, q: np.ndarray, u: np.ndarray, a: np.ndarray, held: HeldCommands
    ) -> tuple[SparseMatrix, SparseMatrix, SparseMatrix]:
        """Return d(f - M a)/dq at fixed accelerations a, df/du and M, shape (n_free, n_free) each."""
        by_q, by_u = self._model.jacobian(time, q, u, held, positive_definite=False)
        position, rate, mass = (np.zeros(len(self._columns)) for _ in range(3))
        scatter(by_q, self._used, self._ones, self._slot, position)
        scatter(by_u, self._used, self._ones, self._slot, rate)
        mass[self._diagonal[: self._model.n_free_nodes]] = self._model.mass
        blocks = self._model.inertia(q)
        if blocks is not None:
            mass[self._inner] = blocks.ravel()
            position[self._inner] -= self._inertia_slope(q, a).ravel()
        return self._matrix(position), self._matrix(rate), self._matrix(mass)

    def stage(
        self, matrices: tuple[SparseMatrix, SparseMatrix, SparseMatrix], rate_step: float
    ) -> SparseMatrix:
        """Return W = M - h df/du - h^2 d(f - M a)/dq of matrices from `at`."""
        position, rate, mass = matrices
        return self._matrix(mass.values - rate_step * (rate.values + rate_step * position.values))

    def _matrix(self, values: np.ndarray) -> SparseMatrix:
        return SparseMatrix(self._starts, self._columns, values)

    def _inertia_slope(self, q: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return d(M a)/d(angles) of each arm, shape (n_arms, n, n); one link of every arm turns at a time."""
        model, links = self._model, self._links
        angles = a[model.n_free_nodes :].reshape(-1, links)
        slope = np.empty((len(angles), links, links))
        moved = q.copy()
        chain = moved[len(q) - angles.size :].reshape(-1, links)
        for link in range(links):
            chain[:, link] += ANGLE_STEP
            ahead = model.inertia(moved)
            chain[:, link] -= 2.0 * ANGLE_STEP
            before = model.inertia(moved)
            chain[:, link] += ANGLE_STEP
            assert ahead is not None and before is not None
            slope[:, :, link] = np.einsum("aij,aj->ai", ahead - before, angles) / (2.0 * ANGLE_STEP)
        return slope


def solve_stage(
    matrix: SparseMatrix,
    factors: Factors,
    right: np.ndarray,
    guess: np.ndarray,
    weight: np.ndarray,
    relative: float,
) -> np.ndarray:
    """Return the solution of W x = right for many right sides, by GMRES with kept factors of a nearby matrix.

    Args:
        matrix: W, shape (n, n).
        factors: Factors of a matrix near W.
        right: Right sides, shape (n, k).
        guess: First guess, shape (n, k).
        weight: Weight of each coordinate's square in norms, shape (n,).
        relative: Error that each column may keep, relative to its norm.
    """
    first = factors.solve(right - matrix @ guess)
    n, k = first.shape
    basis = np.empty((MOST_DIRECTIONS + 1, n, k))
    hessenberg = np.zeros((MOST_DIRECTIONS + 1, MOST_DIRECTIONS, k))
    rotations, known = np.zeros((2, MOST_DIRECTIONS, k)), np.zeros((MOST_DIRECTIONS + 1, k))
    basis[0] = first
    known[0] = np.sqrt(np.einsum("n,nk,nk->k", weight, first, first))
    basis[0] /= np.where(known[0] > 0.0, known[0], 1.0)
    # A column that begins has a guess of zero: the first correction is the size of its solution.
    allowed = relative * np.maximum(np.sqrt(np.einsum("n,nk,nk->k", weight, guess, guess)), known[0])
    for count in range(MOST_DIRECTIONS):
        if (np.abs(known[count]) <= allowed).all():
            return guess + _combined(basis, hessenberg, known, count)
        basis[count + 1] = factors.solve(matrix @ basis[count])
        _extend(basis, hessenberg, rotations, known, count, weight)
    # Kept factors of another contact or of a violent step: the exact matrix costs more, and is always right.
    return np.asarray(sparse_linalg.splu(matrix.to_scipy().tocsc()).solve(right))


@compiled
def _extend(basis, hessenberg, rotations, known, j, weight):  # type: ignore[no-untyped-def]
    # Arnoldi's step by modified Gram-Schmidt for each column, and Givens' rotation of the new column of H.
    n, k = basis.shape[1], basis.shape[2]
    new = basis[j + 1]
    total = np.empty(k)
    for m in range(j + 1):
        total[:] = 0.0
        for i in range(n):
            for c in range(k):
                total[c] += weight[i] * basis[m, i, c] * new[i, c]
        for i in range(n):
            for c in range(k):
                new[i, c] -= total[c] * basis[m, i, c]
        hessenberg[m, j] = total
    total[:] = 0.0
    for i in range(n):
        for c in range(k):
            total[c] += weight[i] * new[i, c] * new[i, c]
    for c in range(k):
        length = np.sqrt(total[c])
        hessenberg[j + 1, j, c] = length
        total[c] = 1.0 / length if length > 0.0 else 0.0
    for i in range(n):
        for c in range(k):
            new[i, c] *= total[c]
    for c in range(k):
        for m in range(j):
            cosine, sine = rotations[0, m, c], rotations[1, m, c]
            above, below = hessenberg[m, j, c], hessenberg[m + 1, j, c]
            hessenberg[m, j, c] = cosine * above + sine * below
            hessenberg[m + 1, j, c] = cosine * below - sine * above
        above, below = hessenberg[j, j, c], hessenberg[j + 1, j, c]
        size = np.hypot(above, below)
        cosine, sine = (above / size, below / size) if size > 0.0 else (1.0, 0.0)
        rotations[0, j, c], rotations[1, j, c] = cosine, sine
        hessenberg[j, j, c] = size
        known[j + 1, c] = -sine * known[j, c]
        known[j, c] = cosine * known[j, c]


@compiled
def _combined(basis, hessenberg, known, count):  # type: ignore[no-untyped-def]
    # The combination of the basis with the least residual.
    n, k = basis.shape[1], basis.shape[2]
    result, part = np.zeros((n, k)), np.zeros((count, k))
    for c in range(k):
        for m in range(count - 1, -1, -1):
            value = known[m, c]
            for later in range(m + 1, count):
                value -= hessenberg[m, later, c] * part[later, c]
            part[m, c] = value / hessenberg[m, m, c] if hessenberg[m, m, c] != 0.0 else 0.0
    for m in range(count):
        for i in range(n):
            for c in range(k):
                result[i, c] += part[m, c] * basis[m, i, c]
    return result

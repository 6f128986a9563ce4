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
# The contraction of one direction may be so much worse than that of the one before.
CONTRACTION_SAFETY = 2.0
# Step of the differences of the arms' inertia, a cosine of angles [rad]: truncation and rounding are near 1e-11.
ANGLE_STEP = 1e-5


@dataclass(frozen=True)
class SparseMatrix:
    """A square matrix by rows, as of `scipy.sparse.csr_matrix`, for products with a few columns.

    Attributes:
        starts: First entry of each row, shape (n + 1,).
        columns: Column of each entry, shape (n_entries,).
        values: The entries.
        whole: Coordinates whose columns are whole, shape (m,), and these columns, shape (n, m), beside the entries.
    """

    starts: np.ndarray
    columns: np.ndarray
    values: np.ndarray
    whole: tuple[np.ndarray, np.ndarray] | None = None

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        if not HAVE_NUMBA:
            return np.asarray(self.to_scipy() @ x)
        result = np.zeros(x.shape)
        _add_product(self.starts, self.columns, self.values, x, result)
        if self.whole is not None:
            result += self.whole[1] @ x[self.whole[0]]
        return result

    def transposed(self) -> SparseMatrix:
        """Return the transposed matrix."""
        turned = self.to_scipy().T.tocsr()
        return SparseMatrix(turned.indptr, turned.indices, turned.data)

    def to_scipy(self) -> sparse.csr_matrix:
        """Return the same as a scipy.sparse.csr_matrix."""
        n = len(self.starts) - 1
        found = sparse.csr_matrix((self.values, self.columns, self.starts), shape=(n, n))
        if self.whole is not None:
            place = sparse.csr_matrix(
                (np.ones(len(self.whole[0])), (np.arange(len(self.whole[0])), self.whole[0])),
                shape=(len(self.whole[0]), n),
            )
            found = found + sparse.csr_matrix(self.whole[1]) @ place
        return found


@compiled
def _add_product(starts, columns, values, x, result):  # type: ignore[no-untyped-def]
    for i in range(starts.size - 1):
        for entry in range(starts[i], starts[i + 1]):
            value, j = values[entry], columns[entry]
            for c in range(x.shape[1]):
                result[i, c] += value * x[j, c]


@compiled
def _add_balance(starts, columns, by_q, by_u, mass, q, u, a, result):  # type: ignore[no-untyped-def]
    # One pass over the pattern that the three matrices share.
    for i in range(starts.size - 1):
        for entry in range(starts[i], starts[i + 1]):
            stiff, damp, heavy, j = by_q[entry], by_u[entry], mass[entry], columns[entry]
            if heavy == 0.0:
                for c in range(q.shape[1]):
                    result[i, c] += stiff * q[j, c] + damp * u[j, c]
            else:
                for c in range(q.shape[1]):
                    result[i, c] += stiff * q[j, c] + damp * u[j, c] - heavy * a[j, c]


class Linearisation:
    """d(f - M a)/dq and df/du of the free coordinates at one instant, and the mass matrix, of one sparse pattern.

    Unlike `LinearSystem` it is exact: neither made symmetric nor positive definite.

    Args:
        model: The model.
        weight: Weight of each coordinate's square in norms, shape (n_free,).
    """

    def __init__(self, model: Model, weight: np.ndarray) -> None:
        self._model, self.weight = model, weight
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
        self._matrices: tuple[SparseMatrix, SparseMatrix, SparseMatrix]

    def linearise(self, time: float, q: np.ndarray, u: np.ndarray, a: np.ndarray, held: HeldCommands) -> None:
        """Take K = d(f - M a)/dq, C = df/du and M at a motion, for what follows."""
        self._matrices = self.at(time, q, u, a, held)

    def balance(self, q: np.ndarray, u: np.ndarray, a: np.ndarray, result: np.ndarray) -> None:
        """Add K q + C u - M a to each row of a result, shape (k, n_free) each."""
        add_balance(self._matrices, q.T, u.T, a.T, result.T)

    def transposed(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return K^T y and C^T y, shape (n_free,) each."""
        position, rate, _ = (matrix.to_scipy().T for matrix in self._matrices)
        return position @ y, rate @ y

    def solve(
        self,
        factors: Factors,
        rate_step: float,
        left_over: np.ndarray,
        guess: np.ndarray,
        relative: float,
        contraction: float,
        *,
        transposed: bool = False,
    ) -> float:
        """Solve W x = right, or W^T x = right, for each row; the guess becomes the solution. See `solve_stage`."""
        matrix = self.stage(self._matrices, rate_step)
        if transposed:
            matrix, factors = matrix.transposed(), factors.transposed()
        found, contraction = solve_stage(
            matrix, factors, left_over.T, guess.T, self.weight, relative, contraction
        )
        guess[:] = found.T
        return contraction

    def solve_exactly(
        self, rate_step: float, left_over: np.ndarray, guess: np.ndarray, *, transposed: bool
    ) -> float:
        """Add W^-1 left_over, or W^-T left_over, to a guess, shape (k, n_free) each; return the contraction 1."""
        matrix = self.stage(self._matrices, rate_step).to_scipy()
        guess += sparse_linalg.splu((matrix.T if transposed else matrix).tocsc()).solve(left_over.T).T
        return 1.0

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
        return self._matrix(position, self._turning(q, held)), self._matrix(rate), self._matrix(mass)

    def _turning(self, q: np.ndarray, held: HeldCommands) -> tuple[np.ndarray, np.ndarray] | None:
        # The Jacobian leaves out how wrenches turn with the sheet: iterations may, derivatives may not.
        model = self._model
        if model.wrench is None or not held.wrenches:
            return None
        columns, slope = model.wrench.position_slope(q, held)
        is_free = np.isin(columns, model.free)
        if not is_free.any():
            return None
        return np.searchsorted(model.free, columns[is_free]), slope[np.ix_(model.free, is_free)]

    def stage(
        self, matrices: tuple[SparseMatrix, SparseMatrix, SparseMatrix], rate_step: float
    ) -> SparseMatrix:
        """Return W = M - h df/du - h^2 d(f - M a)/dq of matrices from `at`."""
        position, rate, mass = matrices
        whole = position.whole
        if whole is not None:
            whole = whole[0], -(rate_step**2) * whole[1]
        return self._matrix(mass.values - rate_step * (rate.values + rate_step * position.values), whole)

    def _matrix(self, values: np.ndarray, whole: tuple[np.ndarray, np.ndarray] | None = None) -> SparseMatrix:
        return SparseMatrix(self._starts, self._columns, values, whole)

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


def add_balance(
    matrices: tuple[SparseMatrix, SparseMatrix, SparseMatrix],
    q: np.ndarray,
    u: np.ndarray,
    a: np.ndarray,
    result: np.ndarray,
) -> None:
    """Add d(f - M a)/dq q + df/du u - M a to a result, of matrices from `Linearisation.at`, shape (n, k) each."""
    position, rate, mass = matrices
    if HAVE_NUMBA:
        values = position.values, rate.values, mass.values
        _add_balance(position.starts, position.columns, *values, q, u, a, result)
        if position.whole is not None:
            result += position.whole[1] @ q[position.whole[0]]
    else:
        result += position @ q + rate @ u - mass @ a


def solve_stage(
    matrix: SparseMatrix,
    factors: Factors,
    left_over: np.ndarray,
    guess: np.ndarray,
    weight: np.ndarray,
    relative: float,
    contraction: float,
) -> tuple[np.ndarray, float]:
    """Return the solution of W x = right for many right sides, by GMRES with kept factors of a nearby matrix.

    Also returned is the contraction: the part of an error that a further direction leaves.

    Args:
        matrix: W, shape (n, n).
        factors: Factors of a matrix near W.
        left_over: right - W guess, shape (n, k).
        guess: First guess, shape (n, k).
        weight: Weight of each coordinate's square in norms, shape (n,).
        relative: Error that each column may keep, relative to its norm.
        contraction: That of an earlier stage with these factors; 1 if none is known.
    """
    first = factors.solve(left_over, single=True)
    n, k = first.shape
    basis = np.empty((MOST_DIRECTIONS + 1, n, k))
    hessenberg = np.zeros((MOST_DIRECTIONS + 1, MOST_DIRECTIONS, k))
    rotations, known = np.zeros((2, MOST_DIRECTIONS, k)), np.zeros((MOST_DIRECTIONS + 1, k))
    basis[0] = first
    known[0] = np.sqrt(np.einsum("n,nk,nk->k", weight, first, first))
    basis[0] /= np.where(known[0] > 0.0, known[0], 1.0)
    # A column that begins has a guess of zero: the first correction is the size of its solution.
    allowed = relative * np.maximum(np.sqrt(np.einsum("n,nk,nk->k", weight, guess, guess)), known[0])
    before = np.abs(known[0])
    for count in range(MOST_DIRECTIONS):
        rest = np.abs(known[count])
        if count > 0:
            # Columns that were at their limit already measure rounding.
            measured = before > 0.1 * allowed
            if measured.any():
                contraction = float((rest[measured] / before[measured]).max())
        # The residual is a correction, too: it leaves the part of itself that one more direction would.
        if (rest * min(CONTRACTION_SAFETY * contraction, 1.0) <= allowed).all():
            return guess + _combined(basis, hessenberg, rotations, known, count), contraction
        before = rest
        basis[count + 1] = factors.solve(matrix @ basis[count], single=True)
        _extend(basis, hessenberg, rotations, known, count, weight)
    # Kept factors of another contact or of a violent step: the exact matrix costs more, and is always right.
    exact = sparse_linalg.splu(matrix.to_scipy().tocsc())
    return guess + np.asarray(exact.solve(left_over)), 1.0


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
def _combined(basis, hessenberg, rotations, known, count):  # type: ignore[no-untyped-def]
    # The combination of the basis with the least residual, and that residual.
    n, k = basis.shape[1], basis.shape[2]
    result, part, rest = np.zeros((n, k)), np.zeros((count + 1, k)), np.zeros(count + 1)
    for c in range(k):
        rest[:] = 0.0
        rest[count] = known[count, c]
        for m in range(count - 1, -1, -1):
            value = known[m, c]
            for later in range(m + 1, count):
                value -= hessenberg[m, later, c] * part[later, c]
            part[m, c] = value / hessenberg[m, m, c] if hessenberg[m, m, c] != 0.0 else 0.0
            cosine, sine, below = rotations[0, m, c], rotations[1, m, c], rest[m + 1]
            rest[m], rest[m + 1] = -sine * below, cosine * below
        for m in range(count + 1):
            part[m, c] += rest[m]
    for m in range(count + 1):
        for i in range(n):
            for c in range(k):
                result[i, c] += part[m, c] * basis[m, i, c]
    return result

"""The symmetric linear systems of implicit steps: Cholesky factors for the lattice, bordered by the arms' angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ldcs_ros.integrators.implicit.banded import Band, BandFactors
from ldcs_ros.integrators.implicit.ordering import inverse_permutation, lower_triangle
from ldcs_ros.physics.compiled import HAVE_NUMBA, compiled
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.block_tridiagonal import BlockFactors, BlockTridiagonal
    from ldcs_ros.integrators.implicit.nested_dissection import Dissection, DissectionFactors
    from ldcs_ros.physics.effects.springs import AxialTerm

    Storage = Band | BlockTridiagonal | Dissection
# Number of free node coordinates from which the sheet is dissected: 33 x 33 nodes and more.
DISSECTED_SIZE = 4000
# A link that has turned by more since the arms' part of the matrix was taken has it taken anew [rad].
TURN = 0.02
# Rotations of the columns where nothing turns.
NO_TURNS = np.zeros((2, 0, 3, 3))


@compiled
def _scatter_loop(values, picked, share, slot, target):  # type: ignore[no-untyped-def]
    for k in range(picked.size):
        target[slot[k]] += values[picked[k]] * share[k]


def _scatter_whole(values, picked, share, slot, target):  # type: ignore[no-untyped-def]
    target += np.bincount(slot, values[picked] * share, minlength=len(target)).astype(target.dtype)


scatter = _scatter_loop if HAVE_NUMBA else _scatter_whole


@compiled
def _invert(matrix):  # type: ignore[no-untyped-def]
    # In place by Gauss and Jordan, without pivots: it is the small Schur complement of a positive definite matrix.
    for p in range(len(matrix)):
        scale = 1.0 / matrix[p, p]
        matrix[p, p] = 1.0
        for j in range(len(matrix)):
            matrix[p, j] *= scale
        for r in range(len(matrix)):
            if r != p:
                factor = matrix[r, p]
                matrix[r, p] = 0.0
                for j in range(len(matrix)):
                    matrix[r, j] -= factor * matrix[p, j]


def _storage_for(n: int) -> type[Storage]:
    """Return the storage for n free node coordinates; a small sheet imports no dissection."""
    if n < DISSECTED_SIZE or not HAVE_NUMBA:
        return Band
    from ldcs_ros.integrators.implicit.nested_dissection import Dissection

    return Dissection


@dataclass(frozen=True)
class Bordered:
    """A symmetric matrix over the free coordinates: sparse for nodes, dense for arm angles.

    Attributes:
        nodes: Values of the nodes' part at the storage's slots, shape (storage.size,).
        border: Nodes' coordinates by angles, shape (n_nodes, n_angles).
        corner: Angles by angles, shape (n_angles, n_angles).
    """

    nodes: np.ndarray
    border: np.ndarray
    corner: np.ndarray


class Factors:
    """A factored matrix W = M - h C - h^2 K, with C = d(force)/du and K = d(force)/dq; `solve` applies W^-1.

    What is kept is G^T W H, where the rotations G and H of the lattice's columns are the identity until `turned`.

    Attributes:
        rate_step: The h of the factored matrix [s].
        angles: Link angles at which border and corner were taken [rad], shape (n_angles,).
        frames: How the lattice's columns stood when it was factored, shape (n_columns, 3, 3).
        turns: G and H, shape (2, n_columns, 3, 3); empty where nothing turns.
        tables: What compiled code reads of them, made by it; copies with other rotations share it.
    """

    tables: object

    def __init__(
        self,
        storage: Storage,
        matrix: Bordered,
        rate_step: float,
        angles: np.ndarray,
        frames: np.ndarray,
    ) -> None:
        self.rate_step, self.frames = rate_step, frames
        self.turns = NO_TURNS
        self._rotated: Callable[..., np.ndarray]  # set with the rotations
        self._scale = 1.0
        self._order, self._n = storage.order, len(storage.order)
        self._nodes = storage.factor(matrix.nodes)
        self._set_border(matrix.border, matrix.corner, angles)

    def _set_border(self, border: np.ndarray, corner: np.ndarray, angles: np.ndarray) -> None:
        self._border, self.angles, self.tables = border, angles, None
        if corner.size:
            self._reach = self._nodes.solve(border)
            self._corner = corner - border.T @ self._reach
            _invert(self._corner)

    def _copy(self) -> Factors:
        # A tenth of the time of copy.copy: a step makes several.
        other = object.__new__(Factors)
        other.__dict__.update(self.__dict__)
        return other

    def bordered(self, border: np.ndarray, corner: np.ndarray, angles: np.ndarray) -> Factors:
        """Return factors with another border and corner."""
        other = self._copy()
        other._set_border(border, corner, angles)
        return other

    def turned(self, turns: np.ndarray, scale: float) -> Factors:
        """Return factors with other rotations G and H, shape (2, n_columns, 3, 3), and a factor on the solution."""
        other = self._copy()
        other.turns, other._scale = turns, scale
        if turns.size:
            from ldcs_ros.physics.column_frames import rotated_vectors

            other._rotated = rotated_vectors
        return other

    def transposed(self) -> Factors:
        """Return the factors of W^T: of H W0 G^T where W is G W0 H^T."""
        return self if not self.turns.size else self.turned(self.turns[::-1], self._scale)

    @property
    def scale(self) -> float:
        """The factor on the solution."""
        return self._scale

    @property
    def parts(
        self,
    ) -> tuple[BandFactors | BlockFactors | DissectionFactors, np.ndarray, np.ndarray, np.ndarray]:
        """The nodes' factors, and border, its solution and the inverted corner, empty without arms."""
        if len(self.angles):
            return self._nodes, self._border, self._reach, self._corner
        return self._nodes, np.zeros((self._n, 0)), np.zeros((self._n, 0)), np.zeros((0, 0))

    def solve(self, right: np.ndarray, *, single: bool = False) -> np.ndarray:
        """Return W^-1 right for free coordinates, shape (n_free,) or (n_free, k); `single` allows that precision."""
        result = np.empty_like(right)
        nodes = right[self._order]
        if self.turns.size:
            nodes = self._rotate(self.turns[0], nodes, back=True)
        if single and isinstance(self._nodes, BandFactors):
            nodes = self._nodes.solve_columns(nodes)
        else:
            nodes = self._nodes.solve(nodes)
        if len(right) > self._n:
            angles = self._corner @ (right[self._n :] - (nodes.T @ self._border).T)
            nodes -= self._reach @ angles
            result[self._n :] = angles
        if self.turns.size:
            nodes = self._rotate(self.turns[1], nodes, back=False)
        result[self._order] = nodes
        if self._scale != 1.0:
            result *= self._scale
        return result

    def _rotate(self, turn: np.ndarray, nodes: np.ndarray, *, back: bool) -> np.ndarray:
        if nodes.ndim == 1:
            return self._rotated(turn, nodes, back)
        from ldcs_ros.physics.column_frames import rotated_columns

        return np.asarray(rotated_columns(turn, nodes, back))


class DirectSlots(NamedTuple):
    """Where the axial springs and the other terms' entries go in the matrix of the nodes.

    Attributes:
        springs: The term that adds itself.
        slots: Places of its entries.
        inner, share, others: Entries of the other terms between nodes, their fractions and places.
        start: Number of the springs' entries before those of the arms.
    """

    springs: AxialTerm
    slots: np.ndarray
    inner: np.ndarray
    share: np.ndarray
    others: np.ndarray
    start: int


class LinearSystem:
    """Where each Jacobian entry of a model goes in storage, border and corner; made once for a model.

    The matrix is made symmetric: an entry and its mirror share the mean.
    """

    def __init__(self, model: Model, storage: type[Storage] | None = None) -> None:
        """Args: model: what is solved for; storage: for the nodes' part, None for the one of the lattice's size."""
        self.model = model
        n = model.n_free_nodes
        rows, columns = model.jacobian_pattern
        used = (rows >= 0) & (columns >= 0)  # -1 is a prescribed coordinate
        inner = used & (np.maximum(rows, columns) < n)
        share = np.where(rows == columns, 1.0, 0.5)
        self._inner, self._inner_share = np.flatnonzero(inner), share[inner]
        if storage is None:
            storage = _storage_for(n)
        self._storage: Storage = storage(model, rows[inner], columns[inner])
        self._order = self._storage.order
        self._columns = self._whole_columns(model)
        n_angles = model.n_free_angles
        # Angles follow the nodes in every order; what is not used may point anywhere.
        place = inverse_permutation(np.append(self._order, np.arange(n, n + n_angles)))
        rows, columns = np.where(used, rows, 0), np.where(used, columns, 0)
        row, column = lower_triangle(place, rows, columns)
        rows, columns = place[rows], place[columns]
        edge = used & (row >= n) & (column < n)
        self._edge, self._edge_share = np.flatnonzero(edge), share[edge]
        self._edge_slot = ((row - n) + column * n_angles)[edge]
        corner = used & (column >= n)
        self._corner = np.flatnonzero(corner)
        self._corner_slot = ((rows - n) * n_angles + columns - n)[corner]
        # Only the arms have entries in border and corner; theirs start here among all entries.
        before = [term for term in model.terms[: model.terms.index(model.arms)]] if model.arms else []
        self._arms_start = sum(len(term.jacobian_pattern()[0]) for term in before)

        self._direct = self._direct_slots(used & inner) if HAVE_NUMBA else None

    def _direct_slots(self, inner: np.ndarray) -> DirectSlots | None:
        # Axial springs have nearly all entries; where they go to the matrix themselves, those of the others follow.
        start = 0
        for term in self.model.terms:
            count = len(term.jacobian_pattern()[0])
            if term.name == "springs":
                from ldcs_ros.physics.effects.springs import AxialTerm

                if not isinstance(term, AxialTerm):
                    break
                slot = np.full(len(inner), -1)
                slot[inner] = self._storage.slots
                rest = (self._inner < start) | (self._inner >= start + count)
                other = self._inner[rest]
                return DirectSlots(
                    term,
                    np.ascontiguousarray(slot[start + term.entries()]),
                    np.where(other < start, other, other - count),
                    self._inner_share[rest],
                    self._storage.slots[rest],
                    count if start <= self._arms_start else 0,
                )
            start += count
        return None

    def _whole_columns(self, model: Model) -> np.ndarray | None:
        # The column of each free node in the storage's order; None where forces do not turn with the sheet, or a
        # node is free in some directions only.
        if not model.corotational:
            return None
        node, axis = np.divmod(model.free[: model.n_free_nodes][self._order], 3)
        if len(node) % 3 or not np.array_equal(
            axis.reshape(-1, 3), np.broadcast_to([0, 1, 2], (len(node) // 3, 3))
        ):
            return None
        return node[::3] % (model.lattice.nodes[0] * model.lattice.nodes[1])

    @property
    def is_banded(self) -> bool:
        """Whether the nodes' part is stored as a band."""
        return isinstance(self._storage, Band)

    @property
    def order(self) -> np.ndarray:
        """Free coordinate at each place of the nodes' matrix, shape (n_free_nodes,)."""
        return self._order

    @property
    def columns(self) -> np.ndarray | None:
        """Column of each free node in that order, shape (n_free_nodes / 3,); None where nothing turns."""
        return self._columns

    def factor(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        rate_step: float,
        *,
        corotated: bool = False,
    ) -> Factors:
        """Return the factored W at a motion: of the exact Jacobian if it is positive definite, else of the stable part.

        Args:
            time: Simulation time [s].
            q: Coordinates [m, rad].
            u: Their rates.
            inputs: What is commanded.
            rate_step: The h of W [s].
            corotated: The factors go through `turn` before they are used.

        Raises:
            numpy.linalg.LinAlgError: Even the stable part is not positive definite or not finite.
        """
        corotated = corotated and self._columns is not None
        try:
            return self._assemble(time, q, u, inputs, rate_step, positive_definite=False, corotated=corotated)
        except np.linalg.LinAlgError:
            return self._assemble(time, q, u, inputs, rate_step, positive_definite=True, corotated=corotated)

    def _assemble(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        rate_step: float,
        *,
        positive_definite: bool,
        corotated: bool,
    ) -> Factors:
        direct = self._direct if corotated else None
        by_position, by_rate = self.model.jacobian(
            time,
            q,
            u,
            inputs,
            positive_definite=positive_definite,
            corotated=corotated,
            without=None if direct is None else direct.springs,
        )
        change = self._placed(-rate_step * (by_rate + rate_step * by_position), direct, q, rate_step)
        if not all(np.isfinite(values).all() for values in (change.nodes, change.border, change.corner)):
            raise np.linalg.LinAlgError("the Jacobian is not finite")
        change.nodes[self._storage.diagonal] += self.model.mass[self._order]
        matrix = replace(change, corner=change.corner + self._inertia(q))
        return Factors(self._storage, matrix, rate_step, self._angles(q), self.frames(q))

    def turn(
        self,
        factors: Factors,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        rate_step: float,
    ) -> Factors:
        """Return kept factors turned to another motion: nearly new ones for the price of a few solves.

        A bent sheet is stiff along itself, so its matrix turns with it: G W0 G^T with a rotation G for each
        column of nodes (stiffness warping, Mueller and others 2002). Its dampers ask for more. With q = q* + h u, the
        force k dL n + c (n . v) n of a spring along n gives W the part h (c + h k) n (n + s dn/dt)^T where
        s = h c / (c + h k): the force acts along the spring as it stands, but is changed by motion along the spring
        as it will stand s later. So W = G W0 H^T is not symmetric, H being the frames of q + s u, while W0, taken of
        a sheet at rest, is. With G on both sides an iteration against stiff springs and soft bending converges for
        tiny turns only. The arms hold the sheet and turn with it, so their couplings are part of W0.

        Args:
            factors: From `factor` with `corotated`.
            time: Simulation time [s].
            q: Coordinates [m, rad] to turn to.
            u: Their rates.
            inputs: What is commanded.
            rate_step: The h of the stage that they will serve [s].
        """
        scale = self.rescaling(factors, rate_step)
        turns = NO_TURNS
        if self._columns is not None:
            # Scenes whose forces do not turn with the sheet load no frames.
            from ldcs_ros.physics.column_frames import fill_rotations

            ahead = self.time_ahead(rate_step)
            turns = np.empty((2, len(self._columns), 3, 3))
            fill_rotations(self.frames(q), factors.frames, self._columns, turns[0])
            fill_rotations(self.frames(q + ahead * u), factors.frames, self._columns, turns[1])
        if self.links_turned(factors, q):
            factors = self.renew_border(factors, time, q, u, inputs, turns)
        return factors.turned(turns, scale)

    def time_ahead(self, rate_step: float) -> float:
        """Return how long after a motion its springs stand as the motion is felt, h c / (c + h k) [s]; see `turn`."""
        tau = self.model.relaxation_time
        return rate_step / (1.0 + rate_step / tau) if tau else 0.0

    def rescaling(self, factors: Factors, rate_step: float) -> float:
        """Return the factor on the solution where factors serve a stage of another h [s]."""
        # W is M + h (tau + h) S, nearly. For another h its stiff directions are r times as stiff and its heavy ones as
        # heavy as before: the mean of both converges in either.
        h, tau = factors.rate_step, self.model.relaxation_time
        return 2.0 / (1.0 + rate_step * (tau + rate_step) / (h * (tau + h))) if tau < np.inf else 1.0

    def links_turned(self, factors: Factors, q: np.ndarray) -> bool:
        """Return whether a link has turned so far since the factors' border that `turn` takes it anew."""
        return bool(np.max(np.abs(self._angles(q) - factors.angles), initial=0.0) > TURN)

    def renew_border(
        self,
        factors: Factors,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        turns: np.ndarray,
    ) -> Factors:
        """Return factors with the arms' part taken anew: against stiff couplings a small turn of a rib matters much."""
        arms, h = self.model.arms, factors.rate_step
        jacobian = arms.corotated_jacobian if turns.size else arms.jacobian  # type: ignore[union-attr]
        by_position, by_rate = jacobian(time, q, u, inputs, False)
        border, corner = self._bordering(-h * (by_rate + h * by_position), self._arms_start)
        if turns.size:
            from ldcs_ros.physics.column_frames import rotated_vectors

            border = np.stack([rotated_vectors(turns[0], column, back=True) for column in border.T], axis=1)
        return factors.bordered(border, corner + self._inertia(q), self._angles(q))

    def _placed(
        self, values: np.ndarray, direct: DirectSlots | None, q: np.ndarray, rate_step: float
    ) -> Bordered:
        nodes = np.zeros(self._storage.size, dtype=self._storage.dtype)
        if direct is None:
            scatter(values, self._inner, self._inner_share, self._storage.slots, nodes)
            return Bordered(nodes, *self._bordering(values, 0))
        direct.springs.add_corotated(q, rate_step, direct.slots, nodes)
        scatter(values, direct.inner, direct.share, direct.others, nodes)
        return Bordered(nodes, *self._bordering(values, direct.start))

    def _bordering(self, values: np.ndarray, start: int) -> tuple[np.ndarray, np.ndarray]:
        n, n_angles = self.model.n_free_nodes, self.model.n_free_angles
        edge = values[self._edge - start] * self._edge_share
        border = np.bincount(self._edge_slot, edge, minlength=n * n_angles)
        corner = np.bincount(self._corner_slot, values[self._corner - start], minlength=n_angles**2)
        corner = corner.reshape(n_angles, n_angles)
        return border.reshape(n, n_angles), 0.5 * (corner + corner.T)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Return the frames of all columns at coordinates q, shape (n_columns, 3, 3); undefined where nothing turns."""
        neighbours = self.model.lattice.column_neighbours
        frames = np.empty((len(neighbours), 3, 3))
        if self._columns is not None:
            from ldcs_ros.physics.column_frames import fill_column_frames

            fill_column_frames(q[: 6 * len(neighbours)].reshape(-1, 3), neighbours, frames)
        return frames

    def _angles(self, q: np.ndarray) -> np.ndarray:
        return q[len(q) - self.model.n_free_angles :].copy()

    def _inertia(self, q: np.ndarray) -> np.ndarray:
        n_angles = self.model.n_free_angles
        corner = np.zeros((n_angles, n_angles))
        blocks = self.model.inertia(q)
        if blocks is not None:
            m = blocks.shape[1]
            for side, block in enumerate(blocks):
                corner[side * m : (side + 1) * m, side * m : (side + 1) * m] = block
        return corner

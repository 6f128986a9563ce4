"""Multifrontal Cholesky factors of the nodes' matrix by nested dissection of the sheet: for large lattices."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import blas, lapack

from ldcs_ros.integrators.implicit.ordering import inverse_permutation, lower_triangle, sheet_places
from ldcs_ros.physics.compiled import compiled, compiled_fast
from ldcs_ros.physics.model import Model

# Columns of nodes in a part of the sheet that is not divided any more (measured from 4 to 64 at 65 x 65).
LEAF = 16


@dataclass
class Front:
    """The coordinates that one part of the sheet, or one separator, eliminates, and those that they are tied to.

    Attributes:
        first: Place of its first own coordinate in the elimination order.
        own: Number of its own coordinates.
        border: Places of later coordinates that it updates, ascending, shape (n_border,).
        children: Fronts whose updates it takes in.
        runs: For each child: border rows of the child that are consecutive here, as (row, local row, length).
        offset: Where its values start: own x own, then border x own, both column-major.
        work: Where its update of the border starts in the workspace while it is made.
        kept: Where the update is moved to, over those of its children.
    """

    first: int
    own: int
    border: np.ndarray
    children: list[Front]
    runs: list[np.ndarray] = field(default_factory=list)
    offset: int = 0
    work: int = 0
    kept: int = 0


class Dissection:
    """A symmetric matrix stored by fronts.

    The sheet is cut in two by a line of columns as wide as springs reach, and so are the halves, until parts are
    small; parts are eliminated first and lines last (George, Nested dissection of a regular finite element mesh,
    1973; Duff and Reid, The multifrontal solution of indefinite sparse symmetric linear equations, 1983). With n
    nodes along a side it costs about n^3 operations where a band costs n^4, and n^2 log n values where a band has
    n^3. Values are in single precision: the iteration corrects what they lack, and they take half the time.

    Attributes:
        order: Free coordinate at each place of the matrix, shape (n,).
        dtype: Of the stored values.
    """

    def __init__(self, model: Model, rows: np.ndarray, columns: np.ndarray) -> None:
        """Args: rows, columns: the free node coordinates of each entry, shape (n_entries,)."""
        layer, i, j, axis = sheet_places(model)
        nx, ny = model.lattice.nodes
        reach_x = int(np.max(np.abs(i[rows] - i[columns]), initial=0))
        reach_y = int(np.max(np.abs(j[rows] - j[columns]), initial=0))
        self.dtype = np.dtype(np.float32)
        by_column = np.lexsort((axis, layer, j, i))
        bounds = np.searchsorted((i * ny + j)[by_column], np.arange(nx * ny + 1))
        coordinates = [by_column[a:b] for a, b in itertools.pairwise(bounds)]
        parts = _Parts((nx, ny), max(reach_x, reach_y, 1))
        self.order = np.concatenate([coordinates[c] for own, _, _ in parts.fronts for c in own])
        place = inverse_permutation(self.order)
        self.fronts = self._fronts(parts, [place[c] for c in coordinates])
        self._lay_out()
        self.slots = self._slots(*lower_triangle(place, rows, columns))
        everyone = np.arange(len(self.order))
        self.diagonal = self._slots(everyone, everyone)

    @staticmethod
    def _fronts(parts: _Parts, places: list[np.ndarray]) -> list[Front]:
        fronts: list[Front] = []
        first = 0
        for own, border, children in parts.fronts:
            size = sum(places[c].size for c in own)
            rows = np.sort(np.concatenate([places[c] for c in border] or [np.zeros(0, dtype=np.int64)]))
            front = Front(first, size, rows, [fronts[child] for child in children])
            for child in front.children:
                inside = child.border < first + size
                local = np.where(inside, child.border - first, size + np.searchsorted(rows, child.border))
                # A run ends where the next row is not the next one here, or lies on the border instead.
                ends = (np.diff(local) != 1) | (np.diff(inside.astype(int)) != 0)
                starts = np.concatenate([[0], np.flatnonzero(ends) + 1]) if local.size else np.zeros(0, int)
                lengths = np.diff(np.append(starts, local.size))
                front.runs.append(np.stack([starts, local[starts], lengths], axis=1).astype(np.int64))
            fronts.append(front)
            first += size
        return fronts

    def _lay_out(self) -> None:
        self.size = top = self._work_size = 0
        for front in self.fronts:
            front.offset, n = self.size, front.border.size
            self.size += front.own * (front.own + n)
            front.work = top
            self._work_size = max(self._work_size, top + n * n)
            front.kept = front.children[0].kept if front.children else top
            top = front.kept + n * n
        # The tree as tables, for the kernel that solves.
        self._firsts, self._owns, self._offsets = (
            np.array([getattr(front, name) for front in self.fronts], dtype=np.int64)
            for name in ("first", "own", "offset")
        )
        self._border_starts = np.concatenate([[0], np.cumsum([front.border.size for front in self.fronts])])
        self._borders = np.concatenate([front.border for front in self.fronts])
        self._widest = max(front.border.size for front in self.fronts)
        self._work = np.empty(0, dtype=self.dtype)

    def _slots(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        front = np.searchsorted(self._firsts, column, side="right") - 1
        # Fronts without own coordinates share their first place with the next one.
        first, own, n_border = self._firsts[front], self._owns[front], np.diff(self._border_starts)[front]
        keys = (
            np.repeat(np.arange(len(self.fronts)), np.diff(self._border_starts)) * len(self.order)
            + self._borders
        )
        at = np.searchsorted(keys, front * len(self.order) + row) - self._border_starts[front]
        inside = row < first + own
        local = np.where(
            inside, row - first + (column - first) * own, own * own + at + (column - first) * n_border
        )
        slots: np.ndarray = self._offsets[front] + local
        return slots

    def factor(self, values: np.ndarray) -> DissectionFactors:
        """Return the factors of a matrix with `values` at its slots, shape (size,).

        Raises:
            numpy.linalg.LinAlgError: It is not positive definite.
        """
        if self._work.size != self._work_size:
            self._work = np.empty(self._work_size, dtype=self.dtype)
        work = self._work
        for front in self.fronts:
            own, n = front.own, front.border.size
            middle = front.offset + own * own
            corner = values[front.offset : middle].reshape((own, own), order="F")
            side = values[middle : middle + n * own].reshape((n, own), order="F")
            update = work[front.work : front.work + n * n].reshape((n, n), order="F")
            update[:] = 0.0
            for child, runs in zip(front.children, front.runs, strict=True):
                m = child.border.size
                _take_in(
                    work[child.kept : child.kept + m * m].reshape((m, m), order="F"),
                    runs,
                    corner,
                    side,
                    update,
                )
            if own:
                _, status = lapack.spotrf(corner, lower=1, clean=0, overwrite_a=1)
                if status != 0:
                    raise np.linalg.LinAlgError("the matrix is not positive definite")
            if n:
                if own:
                    blas.strsm(1.0, corner, side, side=1, lower=1, trans_a=1, overwrite_b=1)
                    blas.ssyrk(-1.0, side, beta=1.0, c=update, lower=1, overwrite_c=1)
                if front.kept != front.work:
                    work[front.kept : front.kept + n * n] = work[front.work : front.work + n * n]
        return DissectionFactors(self, values)


class DissectionFactors:
    """The factors; `solve` applies the inverse."""

    def __init__(self, dissection: Dissection, values: np.ndarray) -> None:
        self._at, self._values = dissection, values

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution for a right side in the matrix's order, shape (n,) or (n, k)."""
        if right.ndim > 1:
            return np.stack([self.solve(column) for column in right.T], axis=1)
        at, solution = self._at, right.astype(self._values.dtype)
        _solve(
            self._values,
            at._firsts,
            at._owns,
            at._offsets,
            at._border_starts,
            at._borders,
            at._widest,
            solution,
        )
        return solution.astype(float)


class _Parts:
    """The tree of a dissected grid of columns: fronts as (own columns, border columns, children), children first."""

    def __init__(self, shape: tuple[int, int], reach: int) -> None:
        self.shape, self.reach = shape, reach
        self.fronts: list[tuple[list[int], list[int], list[int]]] = []
        self._divide(0, shape[0], 0, shape[1])

    def _divide(self, x0: int, x1: int, y0: int, y1: int) -> int:
        wide, high, reach = x1 - x0, y1 - y0, self.reach
        own, children = self._columns(x0, x1, y0, y1), []
        if wide * high > LEAF and max(wide, high) > 2 * reach:
            if wide >= high:
                cut = (x0 + x1 - reach) // 2
                children = [self._divide(x0, cut, y0, y1), self._divide(cut + reach, x1, y0, y1)]
                own = self._columns(cut, cut + reach, y0, y1)
            else:
                cut = (y0 + y1 - reach) // 2
                children = [self._divide(x0, x1, y0, cut), self._divide(x0, x1, cut + reach, y1)]
                own = self._columns(x0, x1, cut, cut + reach)
        around = self._columns(
            max(x0 - reach, 0),
            min(x1 + reach, self.shape[0]),
            max(y0 - reach, 0),
            min(y1 + reach, self.shape[1]),
        )
        inside = set(self._columns(x0, x1, y0, y1))
        self.fronts.append((own, [column for column in around if column not in inside], children))
        return len(self.fronts) - 1

    def _columns(self, x0: int, x1: int, y0: int, y1: int) -> list[int]:
        return [x * self.shape[1] + y for x in range(x0, x1) for y in range(y0, y1)]


@compiled
def _take_in(child, runs, corner, side, update):  # type: ignore[no-untyped-def]
    """Add a child's update to its parent's matrix, run by run of rows that are consecutive in both."""
    own = corner.shape[0]
    for c in range(len(runs)):
        for t in range(runs[c, 2]):
            column, to = runs[c, 0] + t, runs[c, 1] + t
            for r in range(c, len(runs)):
                row, place, length = runs[r, 0], runs[r, 1], runs[r, 2]
                skip = t if r == c else 0
                if to >= own:
                    for k in range(skip, length):
                        update[place - own + k, to - own] += child[row + k, column]
                elif place >= own:
                    for k in range(skip, length):
                        side[place - own + k, to] += child[row + k, column]
                else:
                    for k in range(skip, length):
                        corner[place + k, to] += child[row + k, column]


@compiled_fast
def _solve(values, firsts, owns, offsets, border_starts, borders, widest, x):  # type: ignore[no-untyped-def]
    """Solve L L^T x = right in place, front by front forth and back; four columns at a time, to touch x less."""
    tied = np.empty(widest, dtype=values.dtype)
    n_fronts = firsts.size
    for f in range(n_fronts):
        first, own, n = firsts[f], owns[f], border_starts[f + 1] - border_starts[f]
        corner, border = offsets[f], borders[border_starts[f] : border_starts[f + 1]]
        side = corner + own * own
        mine = x[first : first + own]
        tied[:n] = 0.0
        for j in range(own):
            column = values[corner + j * own : corner + (j + 1) * own]
            value = mine[j] / column[j]
            mine[j] = value
            for i in range(j + 1, own):
                mine[i] -= column[i] * value
        whole = own - own % 4
        for j in range(0, whole, 4):
            b0 = values[side + j * n : side + (j + 1) * n]
            b1 = values[side + (j + 1) * n : side + (j + 2) * n]
            b2 = values[side + (j + 2) * n : side + (j + 3) * n]
            b3 = values[side + (j + 3) * n : side + (j + 4) * n]
            x0, x1, x2, x3 = mine[j], mine[j + 1], mine[j + 2], mine[j + 3]
            for i in range(n):
                tied[i] += b0[i] * x0 + b1[i] * x1 + b2[i] * x2 + b3[i] * x3
        for j in range(whole, own):
            b0, x0 = values[side + j * n : side + (j + 1) * n], mine[j]
            for i in range(n):
                tied[i] += b0[i] * x0
        for i in range(n):
            x[border[i]] -= tied[i]
    for f in range(n_fronts - 1, -1, -1):
        first, own, n = firsts[f], owns[f], border_starts[f + 1] - border_starts[f]
        corner, border = offsets[f], borders[border_starts[f] : border_starts[f + 1]]
        side = corner + own * own
        mine = x[first : first + own]
        for i in range(n):
            tied[i] = x[border[i]]
        whole = own - own % 4
        for j in range(0, whole, 4):
            b0 = values[side + j * n : side + (j + 1) * n]
            b1 = values[side + (j + 1) * n : side + (j + 2) * n]
            b2 = values[side + (j + 2) * n : side + (j + 3) * n]
            b3 = values[side + (j + 3) * n : side + (j + 4) * n]
            s0 = s1 = s2 = s3 = values[corner] * 0
            for i in range(n):
                t = tied[i]
                s0 += b0[i] * t
                s1 += b1[i] * t
                s2 += b2[i] * t
                s3 += b3[i] * t
            mine[j] -= s0
            mine[j + 1] -= s1
            mine[j + 2] -= s2
            mine[j + 3] -= s3
        for j in range(whole, own):
            b0 = values[side + j * n : side + (j + 1) * n]
            for i in range(n):
                mine[j] -= b0[i] * tied[i]
        for j in range(own - 1, -1, -1):
            total = mine[j]
            column = values[corner + j * own : corner + (j + 1) * own]
            for i in range(j + 1, own):
                total -= column[i] * mine[i]
            mine[j] = total / column[j]

"""Stages linearised and solved for many right sides by compiled code, for scenes that the compiled force covers.

Springs are the three vectors n, m and numbers of each: K d = n (m . d) + T/L d and C d = c n (n . d) for the change d
of the far end against the near one. No matrix of them is put together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ldcs_ros.integrators.implicit.dirk_kernel import DirkKernel, solve_turned
from ldcs_ros.integrators.implicit.linearisation import (
    ANGLE_STEP,
    CONTRACTION_SAFETY,
    MOST_DIRECTIONS,
    Linearisation,
)
from ldcs_ros.integrators.implicit.system import Factors, scatter
from ldcs_ros.physics import arm
from ldcs_ros.physics.compiled import compiled, compiled_fast
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.kernels.total_force import SCRATCH_ROWS, TotalForce

# Search directions that all columns of a stage keep.
MOST_KEPT = 32
# Rows of a family's numbers: n, m = (k - T/L) n + c/L (v - (v . n) n), T/L [N/m] and c [N s/m].
BLOCK_ROWS = 8


class LinearTables(NamedTuple):
    """The equation of motion, linearised at an instant: d(f - M a)/dq = K, df/du = C, and M.

    Attributes:
        family: Offset, first near node and one after the last near node of each family, shape (3, n_families).
        blocks: The springs' numbers by near node, shape (n_families, BLOCK_ROWS, n_nodes).
        place: Of each free coordinate of nodes in a structure of arrays, shape (n_free_nodes,).
        scratch: Room, zero at prescribed coordinates, shape (SCRATCH_ROWS, n_nodes).
        mass: Of the free coordinates of nodes [kg].
        rows, columns: Free coordinates of the other effects' entries and the arms' inertia.
        position, rate, inertia: Values of K, C and M there.
    """

    family: np.ndarray
    blocks: np.ndarray
    place: np.ndarray
    scratch: np.ndarray
    mass: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    position: np.ndarray
    rate: np.ndarray
    inertia: np.ndarray


@compiled_fast
def _fill_family(x, v, offset, begin, end, k, pretension, c, blocks):  # type: ignore[no-untyped-def]
    near, far = slice(begin, end), slice(begin + offset, end + offset)
    ax, ay, az, bx, by, bz = x[0, near], x[1, near], x[2, near], x[0, far], x[1, far], x[2, far]
    avx, avy, avz, bvx, bvy, bvz = v[0, near], v[1, near], v[2, near], v[0, far], v[1, far], v[2, far]
    k, pretension, c = k[near], pretension[near], c[near]
    n0, n1, n2 = blocks[0, near], blocks[1, near], blocks[2, near]
    m0, m1, m2 = blocks[3, near], blocks[4, near], blocks[5, near]
    pull, damper = blocks[6, near], blocks[7, near]
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        wx, wy, wz = bvx[e] - avx[e], bvy[e] - avy[e], bvz[e] - avz[e]
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
        along = dx * wx + dy * wy + dz * wz
        tension = k[e] + (c[e] * along - pretension[e]) * inverse
        rotary = c[e] * inverse
        stiff = k[e] - tension - rotary * along
        n0[e], n1[e], n2[e] = dx, dy, dz
        m0[e], m1[e], m2[e] = stiff * dx + rotary * wx, stiff * dy + rotary * wy, stiff * dz + rotary * wz
        pull[e], damper[e] = tension, c[e]


@compiled
def fill_blocks(sheet, tables, q, u):  # type: ignore[no-untyped-def]
    """Write the springs' numbers at a motion into the tables."""
    x, n = sheet.scratch, tables.scratch.shape[1]
    for axis in range(3):
        for e in range(n):
            x[axis, e] = q[3 * e + axis]
            x[3 + axis, e] = u[3 * e + axis]
    spring = sheet.force.spring
    for f in range(tables.family.shape[1]):
        offset, begin, end = tables.family[0, f], tables.family[1, f], tables.family[2, f]
        _fill_family(
            x[:3], x[3:6], offset, begin, end, spring[0, f], spring[1, f], spring[2, f], tables.blocks[f]
        )


@compiled_fast
def _add_family(scratch, offset, begin, end, blocks):  # type: ignore[no-untyped-def]
    near, far = slice(begin, end), slice(begin + offset, end + offset)
    ax, ay, az = scratch[0, near], scratch[1, near], scratch[2, near]
    bx, by, bz = scratch[0, far], scratch[1, far], scratch[2, far]
    au, av, aw = scratch[3, near], scratch[4, near], scratch[5, near]
    bu, bv, bw = scratch[3, far], scratch[4, far], scratch[5, far]
    n0, n1, n2 = blocks[0, near], blocks[1, near], blocks[2, near]
    m0, m1, m2 = blocks[3, near], blocks[4, near], blocks[5, near]
    pull, damper = blocks[6, near], blocks[7, near]
    px, py, pz = scratch[9], scratch[10], scratch[11]
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        along = m0[e] * dx + m1[e] * dy + m2[e] * dz
        along += damper[e] * (n0[e] * (bu[e] - au[e]) + n1[e] * (bv[e] - av[e]) + n2[e] * (bw[e] - aw[e]))
        px[e] = along * n0[e] + pull[e] * dx
        py[e] = along * n1[e] + pull[e] * dy
        pz[e] = along * n2[e] + pull[e] * dz
    for axis in range(3):
        p, here, there = scratch[9 + axis], scratch[6 + axis, near], scratch[6 + axis, far]
        for e in range(here.size):
            here[e] += p[e]
        for e in range(there.size):
            there[e] -= p[e]


@compiled
def add_change(tables, q, u, a, result):  # type: ignore[no-untyped-def]
    """Add K q + C u - M a to a result, free coordinates, shape (n_free,) each."""
    place, scratch = tables.place, tables.scratch
    n_nodes = place.size
    x, v, f = scratch[0:3].reshape(-1), scratch[3:6].reshape(-1), scratch[6:9].reshape(-1)
    f[:] = 0.0
    for i in range(n_nodes):
        x[place[i]] = q[i]
        v[place[i]] = u[i]
    for k in range(tables.family.shape[1]):
        offset, begin, end = tables.family[0, k], tables.family[1, k], tables.family[2, k]
        _add_family(scratch, offset, begin, end, tables.blocks[k])
    for i in range(n_nodes):
        result[i] += f[place[i]] - tables.mass[i] * a[i]
    for e in range(tables.rows.size):
        j = tables.columns[e]
        result[tables.rows[e]] += tables.position[e] * q[j] + tables.rate[e] * u[j] - tables.inertia[e] * a[j]


@compiled_fast
def _add_family_transposed(scratch, offset, begin, end, blocks):  # type: ignore[no-untyped-def]
    near, far = slice(begin, end), slice(begin + offset, end + offset)
    ax, ay, az = scratch[0, near], scratch[1, near], scratch[2, near]
    bx, by, bz = scratch[0, far], scratch[1, far], scratch[2, far]
    n0, n1, n2 = blocks[0, near], blocks[1, near], blocks[2, near]
    m0, m1, m2 = blocks[3, near], blocks[4, near], blocks[5, near]
    pull, damper = blocks[6, near], blocks[7, near]
    px, py, pz = scratch[9], scratch[10], scratch[11]
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        along = n0[e] * dx + n1[e] * dy + n2[e] * dz
        px[e] = along * m0[e] + pull[e] * dx
        py[e] = along * m1[e] + pull[e] * dy
        pz[e] = along * m2[e] + pull[e] * dz
    for axis in range(3):
        p, here, there = scratch[9 + axis], scratch[3 + axis, near], scratch[3 + axis, far]
        for e in range(here.size):
            here[e] += p[e]
        for e in range(there.size):
            there[e] -= p[e]
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        along = damper[e] * (n0[e] * dx + n1[e] * dy + n2[e] * dz)
        px[e], py[e], pz[e] = along * n0[e], along * n1[e], along * n2[e]
    for axis in range(3):
        p, here, there = scratch[9 + axis], scratch[6 + axis, near], scratch[6 + axis, far]
        for e in range(here.size):
            here[e] += p[e]
        for e in range(there.size):
            there[e] -= p[e]


@compiled
def add_transposed(tables, y, by_q, by_u, by_a):  # type: ignore[no-untyped-def]
    """Add K^T y to by_q, C^T y to by_u and M y to by_a, free coordinates, shape (n_free,) each."""
    place, scratch = tables.place, tables.scratch
    n_nodes = place.size
    x, f, g = scratch[0:3].reshape(-1), scratch[3:6].reshape(-1), scratch[6:9].reshape(-1)
    f[:] = 0.0
    g[:] = 0.0
    for i in range(n_nodes):
        x[place[i]] = y[i]
    for k in range(tables.family.shape[1]):
        offset, begin, end = tables.family[0, k], tables.family[1, k], tables.family[2, k]
        _add_family_transposed(scratch, offset, begin, end, tables.blocks[k])
    for i in range(n_nodes):
        by_q[i] += f[place[i]]
        by_u[i] += g[place[i]]
        by_a[i] += tables.mass[i] * y[i]
        # `add_change` finds rates of prescribed coordinates to be zero there.
    f[:] = 0.0
    for e in range(tables.rows.size):
        i, j = tables.rows[e], tables.columns[e]
        by_q[j] += tables.position[e] * y[i]
        by_u[j] += tables.rate[e] * y[i]
        by_a[j] += tables.inertia[e] * y[i]


@compiled
def times_stage(tables, rate_step, transposed, x, result, room):  # type: ignore[no-untyped-def]
    """Write W x = M x - h C x - h^2 K x, or W^T x, to a result; room has shape (3, n_free)."""
    n = x.size
    result[:] = 0.0
    room[:] = 0.0
    if transposed:
        add_transposed(tables, x, room[0], room[1], result)
        for i in range(n):
            result[i] -= rate_step * (room[1, i] + rate_step * room[0, i])
    else:
        for i in range(n):
            room[2, i] = -x[i]
            room[1, i] = rate_step * room[2, i]
            room[0, i] = rate_step * room[1, i]
        add_change(tables, room[0], room[1], room[2], result)


@compiled_fast
def _inner(weight, x, y):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(x.size):
        total += weight[i] * x[i] * y[i]
    return total


@compiled_fast
def _add_multiple(factor, x, y):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        y[i] += factor * x[i]


@compiled
def solve_columns(  # type: ignore[no-untyped-def]
    tables,
    factors,
    turns,
    scale,
    rate_step,
    transposed,
    weight,
    relative,
    contraction,
    left_over,
    solution,
    kept,
):
    """Solve W x = right for each row of right sides, by generalised conjugate residuals with kept factors.

    All rows share their search directions: for each kept direction z the image P^-1 W z is kept, too, P being the
    matrix of the factors. What is left after them is a correction itself.

    Args:
        tables: `LinearTables` of W.
        factors, turns, scale: Kept factors of a nearby matrix.
        rate_step: The h of W [s].
        transposed: Solve with W^T; the turns are then those of its factors.
        weight: Weight of each coordinate's square in norms, shape (n_free,).
        relative: Error that each row may keep, relative to its norm.
        contraction: Part of an error that one more direction leaves, of an earlier stage; 1 if none is known.
        left_over: right - W x of the guess, shape (k, n_free); it changes.
        solution: The guess, which becomes the solution, same shape.
        kept: Room, shape (2, MOST_KEPT, n_free).

    Returns:
        The contraction; negative if a row does not converge.
    """
    n, room, count = weight.size, np.empty((3, weight.size)), 0
    for c in range(left_over.shape[0]):
        rest, x = left_over[c], solution[c]
        solve_turned(factors, turns, scale, rest)
        # A column that begins has a guess of zero: the first correction is the size of its solution.
        allowed = relative * math.sqrt(max(_inner(weight, x, x), _inner(weight, rest, rest)))
        for k in range(count):
            part = _inner(weight, kept[1, k], rest)
            _add_multiple(part, kept[0, k], x)
            _add_multiple(-part, kept[1, k], rest)
        size, searched = math.sqrt(_inner(weight, rest, rest)), 0
        while not size * min(CONTRACTION_SAFETY * contraction, 1.0) <= allowed:
            if searched == MOST_DIRECTIONS or not size < np.inf:
                return -1.0
            if count == MOST_KEPT:
                count = 0
            z, image = kept[0, count], kept[1, count]
            z[:] = rest
            times_stage(tables, rate_step, transposed, z, image, room)
            solve_turned(factors, turns, scale, image)
            for _ in range(2):
                for k in range(count):
                    part = _inner(weight, kept[1, k], image)
                    _add_multiple(-part, kept[1, k], image)
                    _add_multiple(-part, kept[0, k], z)
            length = math.sqrt(_inner(weight, image, image))
            if not length > 0.0:
                return -1.0
            for i in range(n):
                z[i] /= length
                image[i] /= length
            part = _inner(weight, image, rest)
            _add_multiple(part, z, x)
            _add_multiple(-part, image, rest)
            before, size = size, math.sqrt(_inner(weight, rest, rest))
            # Columns that were at their limit already measure rounding.
            if before > 0.1 * allowed:
                contraction = size / before
            count += 1
            searched += 1
        _add_multiple(1.0, rest, x)
    return contraction


@compiled
def _fill_inertia_slope(tables, phi, a, ahead, before, slope):  # type: ignore[no-untyped-def]
    # d(M a)/d(angles) of each arm, shape (n_arms, n, n); one link of every arm turns at a time.
    links = phi.shape[1]
    for link in range(links):
        phi[:, link] += ANGLE_STEP
        arm.fill_inertia(phi, tables.arms, tables.links, ahead)
        phi[:, link] -= 2.0 * ANGLE_STEP
        arm.fill_inertia(phi, tables.arms, tables.links, before)
        phi[:, link] += ANGLE_STEP
        for side in range(phi.shape[0]):
            for i in range(links):
                total = 0.0
                for j in range(links):
                    total += (ahead[side, i, j] - before[side, i, j]) * a[side, j]
                slope[side, i, link] = total / (2.0 * ANGLE_STEP)


class LinearKernel:
    """The linearised equation of motion of one model, as `Linearisation` has it, and its stages.

    Args:
        kernel: The tables of the model and its method.
        exact: The same equation as matrices, for what does not converge.
    """

    def __init__(self, kernel: DirkKernel, exact: Linearisation) -> None:
        self._kernel, self._exact, self._weight = kernel, exact, exact.weight
        self._model = model = kernel.force.model
        n, first = len(model.free), model.n_free_nodes
        place = np.full(model.n_coordinates, -1)
        place[model.free] = np.arange(n)
        self._terms = [term for term in model.terms if term.name != "springs"]
        pairs = [term.jacobian_pattern() for term in self._terms]
        rows, columns = (
            place[np.concatenate([pair[k] for pair in pairs] or [np.zeros(0, dtype=int)])] for k in range(2)
        )
        self._used = np.flatnonzero((rows >= 0) & (columns >= 0))
        self._ones = np.ones(len(self._used))
        self._chain = kernel.sheet.inertia.shape
        links = self._chain[1]
        angle = np.arange(n - first)
        inner_row, inner_column = np.nonzero((angle[:, None] // max(links, 1)) == (angle // max(links, 1)))
        keys = [
            rows[self._used] * n + columns[self._used],
            (first + inner_row) * n + first + inner_column,
        ]
        pattern, slot = np.unique(np.concatenate(keys), return_inverse=True)
        self._slot, self._inner = np.split(slot.ravel(), [len(keys[0])])
        node, axis = np.divmod(model.free[:first], 3)
        force: TotalForce = kernel.force
        n_families, n_nodes = force.tables.family.shape[1], model.lattice.n_nodes
        self.tables = LinearTables(
            force.tables.family,
            np.zeros((n_families, BLOCK_ROWS, n_nodes)),
            axis * n_nodes + node,
            np.zeros((SCRATCH_ROWS, n_nodes)),
            model.mass,
            pattern // n,
            pattern % n,
            *np.zeros((3, len(pattern))),
        )
        self._kept = np.empty((2, MOST_KEPT, n))

    def linearise(self, time: float, q: np.ndarray, u: np.ndarray, a: np.ndarray, held: HeldCommands) -> None:
        """Take K, C and M at a motion, a being the accelerations of the free coordinates."""
        tables, sheet, self._instant = self.tables, self._kernel.sheet, (time, q, u, a, held)
        fill_blocks(sheet, tables, q, u)
        position, rate, inertia = tables.position, tables.rate, tables.inertia
        position[:], rate[:] = 0.0, 0.0
        if self._used.size:
            values = [term.jacobian(time, q, u, held, False) for term in self._terms]
            scatter(
                np.concatenate([value[0] for value in values]), self._used, self._ones, self._slot, position
            )
            scatter(np.concatenate([value[1] for value in values]), self._used, self._ones, self._slot, rate)
        if self._inner.size:
            model, (arms, links, _) = self._model, self._chain
            slope, ahead, before = np.empty((3, arms, links, links))
            chain = q[len(q) - arms * links :].reshape(arms, links).copy()
            rates = a[model.n_free_nodes :].reshape(arms, links)
            table = sheet.force.arms
            _fill_inertia_slope(table, chain, rates, ahead, before, slope)
            arm.fill_inertia(chain, table.arms, table.links, ahead)
            inertia[self._inner] = ahead.ravel()
            position[self._inner] -= slope.ravel()

    def balance(self, q: np.ndarray, u: np.ndarray, a: np.ndarray, result: np.ndarray) -> None:
        """Add K q + C u - M a to each row of a result, shape (k, n_free) each."""
        for rows in zip(q, u, a, result, strict=True):
            add_change(self.tables, *rows)

    def transposed(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return K^T y and C^T y, shape (n_free,) each."""
        by_q, by_u, by_a = np.zeros((3, len(y)))
        add_transposed(self.tables, y, by_q, by_u, by_a)
        return by_q, by_u

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
        """Solve W x = right, or W^T x = right, for each row; see `solve_columns`. The guess becomes the solution."""
        if transposed:
            factors = factors.transposed()
        begun = left_over.copy(), guess.copy()
        contraction = float(
            solve_columns(
                self.tables,
                self._kernel.tables(factors),
                factors.turns,
                factors.scale,
                rate_step,
                transposed,
                self._weight,
                relative,
                contraction,
                left_over,
                guess,
                self._kept,
            )
        )
        if contraction >= 0.0:
            return contraction
        left_over[:], guess[:] = begun
        self._exact.linearise(*self._instant)
        return self._exact.solve_exactly(rate_step, left_over, guess, transposed=transposed)

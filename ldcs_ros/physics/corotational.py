"""The corotational spring law: vector springs in the best-fit rotated frame of each node.

Each node i with its springs j forms a star. With r_j = x_j - x_i, rest vectors d_j and half a spring for each
end,

    E_i = sum_j k_j/4 |r_j - R_i d_j|^2,      R_i = the rotation that minimises it,
    D_i = sum_j c_j/4 |r_j' - w_i x r_j|^2,   w_i = the angular velocity that minimises it,

so a spring pulls with k (r - (R_a + R_b) d / 2) as in Sorkine and Alexa (2007), "As-rigid-as-possible surface
modeling". R_i and w_i are minimisers, so their own change drops out of the force, and rigid motion gives
none. The exact Jacobian follows by eliminating them: E_xx - E_xw E_ww^-1 E_wx, a correction of rank three a
star.
"""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.effects.base import Term
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.rotation import best_rotation, fill_cross, inverse


@compiled
def _spin(r, v, c, first, last, moment, spin):  # type: ignore[no-untyped-def]
    # Angular velocity of least dissipation: J w = sum c/2 r x v, J = sum c/2 (|r|^2 1 - r r^T); writes J and
    # w.
    moment[:] = 0.0
    angular = np.zeros(3)
    for s in range(first, last):
        half = 0.5 * c[s]
        square = r[s, 0] ** 2 + r[s, 1] ** 2 + r[s, 2] ** 2
        for i in range(3):
            moment[i, i] += half * square
            for j in range(3):
                moment[i, j] -= half * r[s, i] * r[s, j]
        angular[0] += half * (r[s, 1] * v[s, 2] - r[s, 2] * v[s, 1])
        angular[1] += half * (r[s, 2] * v[s, 0] - r[s, 0] * v[s, 2])
        angular[2] += half * (r[s, 0] * v[s, 1] - r[s, 1] * v[s, 0])
    back = np.empty((3, 3))
    inverse(moment, back)
    for i in range(3):
        spin[i] = back[i, 0] * angular[0] + back[i, 1] * angular[1] + back[i, 2] * angular[2]


@compiled
def _fit(r, d, k, first, last, rotation):  # type: ignore[no-untyped-def]
    # m = sum k r d^T, of which the best rotation is the orthogonal factor.
    m = np.zeros((3, 3))
    for s in range(first, last):
        for i in range(3):
            for j in range(3):
                m[i, j] += k[s] * r[s, i] * d[s, j]
    best_rotation(m, rotation)


@compiled
def _stretch(x, v, start, member, r, rate):  # type: ignore[no-untyped-def]
    for i in range(start.size - 1):
        for s in range(start[i], start[i + 1]):
            for axis in range(3):
                r[s, axis] = x[member[s], axis] - x[i, axis]
                rate[s, axis] = v[member[s], axis] - v[i, axis]


@compiled
def _add_force(x, v, start, member, d, k, c, force):  # type: ignore[no-untyped-def]
    r, rate = np.empty(d.shape), np.empty(d.shape)
    _stretch(x, v, start, member, r, rate)
    rotation, moment, spin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    spin_rate = np.empty(3)
    for i in range(start.size - 1):
        first, last = start[i], start[i + 1]
        _fit(r, d, k, first, last, rotation)
        _spin(r, rate, c, first, last, moment, spin)
        for s in range(first, last):
            spin_rate[0] = spin[1] * r[s, 2] - spin[2] * r[s, 1]
            spin_rate[1] = spin[2] * r[s, 0] - spin[0] * r[s, 2]
            spin_rate[2] = spin[0] * r[s, 1] - spin[1] * r[s, 0]
            for axis in range(3):
                rotated = (
                    rotation[axis, 0] * d[s, 0] + rotation[axis, 1] * d[s, 1] + rotation[axis, 2] * d[s, 2]
                )
                pull = 0.5 * k[s] * (r[s, axis] - rotated) + 0.5 * c[s] * (rate[s, axis] - spin_rate[axis])
                force[3 * i + axis] += pull
                force[3 * member[s] + axis] -= pull


@compiled
def _energy(x, start, member, d, k):  # type: ignore[no-untyped-def]
    r, rate = np.empty(d.shape), np.empty(d.shape)
    _stretch(x, x, start, member, r, rate)
    rotation = np.empty((3, 3))
    total = 0.0
    for i in range(start.size - 1):
        first, last = start[i], start[i + 1]
        _fit(r, d, k, first, last, rotation)
        for s in range(first, last):
            for axis in range(3):
                rotated = (
                    rotation[axis, 0] * d[s, 0] + rotation[axis, 1] * d[s, 1] + rotation[axis, 2] * d[s, 2]
                )
                total += 0.25 * k[s] * (r[s, axis] - rotated) ** 2
    return total


@compiled
def _fill_jacobian(x, v, start, member, d, k, c, positive_definite, slot, slot_start, by_position, by_rate):  # type: ignore[no-untyped-def]
    r, rate = np.empty(d.shape), np.empty(d.shape)
    _stretch(x, v, start, member, r, rate)
    rotation, moment, spin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    back_g, back_j, cross_spin = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    p = np.empty(3)
    for i in range(start.size - 1):
        first, last = start[i], start[i + 1]
        size = last - first + 1  # the centre is the last member of its star
        _fit(r, d, k, first, last, rotation)
        _spin(r, rate, c, first, last, moment, spin)
        inverse(moment, back_j)
        fill_cross(spin, 1.0, cross_spin)
        g = np.zeros((3, 3))
        # arm, lever and twist: mixed derivatives of E by (x, R), of D by (v, w) and of D by (x, w), a member each.
        arm, lever, twist = np.zeros((size, 3, 3)), np.zeros((size, 3, 3)), np.zeros((size, 3, 3))
        for s in range(first, last):
            m, half_k, half_c = s - first, 0.5 * k[s], 0.5 * c[s]
            dot = spin_dot = 0.0
            for axis in range(3):
                p[axis] = (
                    rotation[axis, 0] * d[s, 0] + rotation[axis, 1] * d[s, 1] + rotation[axis, 2] * d[s, 2]
                )
                dot += p[axis] * (p[axis] if positive_definite else r[s, axis])
                spin_dot += spin[axis] * r[s, axis]
            for a in range(3):
                g[a, a] += half_k * dot
                for b in range(3):
                    if positive_definite:
                        g[a, b] -= half_k * p[a] * p[b]
                    else:
                        g[a, b] -= 0.5 * half_k * (r[s, a] * p[b] + p[a] * r[s, b])
            fill_cross(p, half_k, arm[m])
            fill_cross(r[s], half_c, lever[m])
            if not positive_definite:
                fill_cross(rate[s], -half_c, twist[m])
                for a in range(3):
                    twist[m, a, a] += half_c * spin_dot
                    for b in range(3):
                        twist[m, a, b] += half_c * (r[s, a] * spin[b] - 2.0 * spin[a] * r[s, b])
            arm[size - 1] -= arm[m]
            lever[size - 1] -= lever[m]
            twist[size - 1] -= twist[m]
        # The rotation and the spin are eliminated: - E_xw E_ww^-1 E_wx for every pair of members.
        inverse(g, back_g)
        at = slot_start[i]
        for m in range(size):
            left_arm, left_lever = arm[m] @ back_g, lever[m] @ back_j
            for o in range(size):
                place = slot[at + m * size + o]  # the star's blocks are stored row by row
                for a in range(3):
                    for b in range(3):
                        release = damp = 0.0
                        for e in range(3):
                            release += left_arm[a, e] * arm[o, b, e]
                            damp += left_lever[a, e] * lever[o, b, e]
                            if not positive_definite:
                                release -= left_lever[a, e] * twist[o, e, b]
                        by_position[place, a, b] += release
                        by_rate[place, a, b] += damp
        # The springs themselves: - 1 on the member and on the centre, + 1 between them.
        centre = size - 1
        for s in range(first, last):
            m, half_k, half_c = s - first, 0.5 * k[s], 0.5 * c[s]
            for a in range(3):
                for b in range(3):
                    stiff = half_k if a == b else 0.0
                    damp = half_c if a == b else 0.0
                    if not positive_definite:
                        stiff -= half_c * cross_spin[a, b]
                    for row, column, sign in (
                        (m, m, -1.0),
                        (m, centre, 1.0),
                        (centre, m, 1.0),
                        (centre, centre, -1.0),
                    ):
                        by_position[slot[at + row * size + column], a, b] += sign * stiff
                        by_rate[slot[at + row * size + column], a, b] += sign * damp


class CorotationalTerm(Term):
    """Stars of all nodes in compressed rows: star i has the springs start[i] ... start[i + 1]."""

    name = "springs"
    corotational = True

    def __init__(self, lattice: Lattice, stiffness: np.ndarray, damping: np.ndarray) -> None:
        self.n = lattice.n_nodes
        ends = np.concatenate([lattice.springs, lattice.springs[:, ::-1]])
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        ends = ends[order]
        self.member = np.ascontiguousarray(ends[:, 1])
        self.start = np.searchsorted(ends[:, 0], np.arange(self.n + 1))
        self.rest = lattice.reference_position[self.member] - lattice.reference_position[ends[:, 0]]
        # Both ends of a spring have its values.
        self.k, self.c = np.tile(stiffness, 2)[order], np.tile(damping, 2)[order]
        self._place_blocks()

    def _place_blocks(self) -> None:
        # A block for every pair of nodes of one star; slot maps (star, member, member) to its block.
        keys, self.slot_start = [], np.zeros(self.n + 1, dtype=np.int64)
        for i in range(self.n):
            star = np.append(self.member[self.start[i] : self.start[i + 1]], i)
            keys.append((star[:, None] * self.n + star).ravel())
            self.slot_start[i + 1] = self.slot_start[i] + star.size**2
        pairs, self.slot = np.unique(np.concatenate(keys), return_inverse=True)
        self.pairs = np.stack([pairs // self.n, pairs % self.n], axis=1)

    def _nodes(self, flat: np.ndarray) -> np.ndarray:
        return flat[: 3 * self.n].reshape(-1, 3)

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        _add_force(self._nodes(q), self._nodes(u), self.start, self.member, self.rest, self.k, self.c, force)

    def energy(self, time: float, q: np.ndarray) -> float:
        return float(_energy(self._nodes(q), self.start, self.member, self.rest, self.k))

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        axes = np.arange(3)
        rows, columns = np.broadcast_arrays(
            3 * self.pairs[:, 0, None, None] + axes[:, None], 3 * self.pairs[:, 1, None, None] + axes
        )
        return rows.ravel(), columns.ravel()

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        by_position, by_rate = np.zeros((len(self.pairs), 3, 3)), np.zeros((len(self.pairs), 3, 3))
        _fill_jacobian(
            self._nodes(q),
            self._nodes(u),
            self.start,
            self.member,
            self.rest,
            self.k,
            self.c,
            positive_definite,
            self.slot,
            self.slot_start,
            by_position,
            by_rate,
        )
        return by_position.ravel(), by_rate.ravel()

"""The compiled pieces that implicit steps share: solve with turned and bordered factors, mass, residual."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ldcs_ros.integrators.implicit.block_tridiagonal import BlockFactors, solve_blocks
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics import arm
from ldcs_ros.physics.column_frames import fill_column_frames, fill_rotations
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.kernels.total_force import add_total_force


class FactorTables(NamedTuple):
    """Kept factors with the storage `BlockTridiagonal`, as kernels read them.

    Attributes:
        order: Free coordinate at each place of the nodes' matrix, shape (n_nodes,).
        inverse: Inverted diagonal blocks, shape (n_slabs, padded, padded).
        link: Blocks below them times those, shape (n_slabs - 1, padded, padded).
        link_transposed: The same transposed.
        block: Coordinates of a slab.
        room: Scratch of a solve.
        border: Border of the arms and its solution, shape (2, n_nodes, n_angles).
        corner: Inverted corner, shape (n_angles, n_angles).
        columns: Column of each free node in `order`, shape (n_nodes / 3,); empty where nothing turns.
        neighbours: Neighbours of each column, for its frame.
        frames: How the columns stood when W was factored, shape (n_columns, 3, 3).
        rate_step: The h of W [s].
    """

    order: np.ndarray
    inverse: np.ndarray
    link: np.ndarray
    link_transposed: np.ndarray
    block: int
    room: np.ndarray
    border: np.ndarray
    corner: np.ndarray
    columns: np.ndarray
    neighbours: np.ndarray
    frames: np.ndarray
    rate_step: float


def factor_tables(system: LinearSystem, factors: Factors) -> FactorTables:
    """Return the tables of kept factors."""
    blocks, border, reach, corner = factors.parts
    assert isinstance(blocks, BlockFactors)
    return FactorTables(
        system.order,
        blocks.inverse,
        blocks.link,
        blocks.link_transposed,
        blocks.block,
        blocks.room,
        np.stack([border, reach]),
        corner,
        np.zeros(0, dtype=np.int64) if system.columns is None else system.columns,
        system.model.lattice.column_neighbours,
        factors.frames,
        factors.rate_step,
    )


@compiled
def fill_both_rotations(factors, n_nodes, ahead, q, u, turns):  # type: ignore[no-untyped-def]
    """Write the rotations G of a motion and H of the time `ahead` later, shape (2, n_columns, 3, 3).

    n_nodes are all nodes of the lattice; q and u are all coordinates and rates.
    """
    if factors.columns.size > 0:
        now, sheet = np.empty(factors.frames.shape), 3 * n_nodes
        fill_column_frames(q[:sheet].reshape(-1, 3), factors.neighbours, now)
        fill_rotations(now, factors.frames, factors.columns, turns[0])
        fill_column_frames((q[:sheet] + ahead * u[:sheet]).reshape(-1, 3), factors.neighbours, now)
        fill_rotations(now, factors.frames, factors.columns, turns[1])


@compiled
def into_sheet(factors, turns, right, nodes):  # type: ignore[no-untyped-def]
    """Write G^T times a right side of the free coordinates, for the nodes in the matrix's order."""
    order = factors.order
    turned = turns.shape[1] > 0
    for k in range(order.size // 3 if turned else 0):
        for r in range(3):
            total = 0.0
            for t in range(3):
                total += turns[0, k, t, r] * right[order[3 * k + t]]
            nodes[3 * k + r] = total
    for k in range(0 if turned else order.size):
        nodes[k] = right[order[k]]


@compiled
def out_of_sheet(factors, turns, scale, nodes, right):  # type: ignore[no-untyped-def]
    """Finish `Factors.solve`: the border of the arms, H and the scale; right becomes the solution.

    nodes hold the solution of the nodes' part alone; border[0] is B, border[1] is W^-1 B.
    """
    order, border, corner = factors.order, factors.border, factors.corner
    n, n_angles = order.size, border.shape[2]
    turned = turns.shape[1] > 0
    if n_angles > 0:
        left = np.empty(n_angles)
        for a in range(n_angles):
            left[a] = right[n + a]
        for k in range(n):
            for a in range(n_angles):
                left[a] -= nodes[k] * border[0, k, a]
        for a in range(n_angles):
            total = 0.0
            for b in range(n_angles):
                total += corner[a, b] * left[b]
            right[n + a] = scale * total
        for k in range(n):
            total = 0.0
            for a in range(n_angles):
                total += border[1, k, a] * right[n + a]
            nodes[k] = scale * nodes[k] - total
    elif scale != 1.0:
        for k in range(n):
            nodes[k] *= scale
    for k in range(n // 3 if turned else 0):
        for r in range(3):
            total = 0.0
            for t in range(3):
                total += turns[1, k, r, t] * nodes[3 * k + t]
            right[order[3 * k + r]] = total
    for k in range(0 if turned else n):
        right[order[k]] = nodes[k]


@compiled
def solve_factors(factors, turns, scale, right):  # type: ignore[no-untyped-def]
    """Replace a right side by `scale` times the solution with turned block factors, free coordinates."""
    nodes = np.empty(factors.order.size)
    into_sheet(factors, turns, right, nodes)
    solve_blocks(factors.inverse, factors.link, factors.link_transposed, factors.block, factors.room, nodes)
    out_of_sheet(factors, turns, scale, nodes, right)


@compiled
def times_mass(inertia, mass, vector, n_nodes):  # type: ignore[no-untyped-def]
    """Replace a vector of free coordinates by M times it; inertia is that of the arms, shape (n_arms, n, n)."""
    for i in range(n_nodes):
        vector[i] *= mass[i]
    if inertia.shape[0] > 0:
        links = inertia.shape[1]
        result = np.empty(links)
        for side in range(inertia.shape[0]):
            part = vector[n_nodes + side * links : n_nodes + (side + 1) * links]
            for k in range(links):
                total = 0.0
                for m in range(links):
                    total += inertia[side, k, m] * part[m]
                result[k] = total
            part[:] = result


@compiled
def fill_residual(tables, drive, steady, scratch, free, mass, q, u, a, inertia, force, residual):  # type: ignore[no-untyped-def]
    """Write the free coordinates' force minus M a [N, N m] to `residual`, and the arms' inertia.

    Args:
        tables: `ForceTables`.
        drive: Drive torque of each joint [N m], shape (n_arms, n_links).
        steady: Constant forces on all coordinates.
        scratch: Room for `add_total_force`.
        free: Free coordinates, nodes first, shape (n_free,).
        mass: Of the free coordinates of nodes [kg], shape (n_nodes,) or longer.
        q: Coordinates.
        u: Their rates.
        a: Accelerations of the free coordinates.
        inertia: Becomes the mass matrix of each arm whose angles are free, shape (n_arms or 0, n_links, n_links).
        force: Room, shape of q.
        residual: Shape of a.
    """
    force[:] = steady
    add_total_force(tables, drive, q, u, scratch, force)
    first, links = 3 * scratch.shape[1], inertia.shape[1]
    n_nodes = free.size - inertia.shape[0] * links
    for i in range(n_nodes):
        residual[i] = force[free[i]] - mass[i] * a[i]
    if inertia.shape[0] > 0:
        phi = q[first:].reshape(-1, links)
        arm.fill_inertia(phi, tables.arms.arms, tables.arms.links, inertia)
        for side in range(inertia.shape[0]):
            for k in range(links):
                total = force[first + side * links + k]
                for m in range(links):
                    total -= inertia[side, k, m] * a[n_nodes + side * links + m]
                residual[n_nodes + side * links + k] = total

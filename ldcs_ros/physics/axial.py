"""Kernels of the axial spring law; loops where numba compiles them, whole-array NumPy where it is absent."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.physics.compiled import HAVE_NUMBA, compiled

# Below this fraction of its rest length a spring has lost its direction, and its rest axis takes over.
# So coincident nodes are pushed apart, and nothing is divided by zero.
LOST_LENGTH = 1e-9


@compiled
def _add_force_loop(q, u, a, b, rest_length, rest_axis, k, c, force):  # type: ignore[no-untyped-def]
    for s in range(a.size):
        # x, y and z of node n are at 3 n, 3 n + 1 and 3 n + 2 of the flat vectors.
        i, j = 3 * a[s], 3 * b[s]
        dx, dy, dz = q[j] - q[i], q[j + 1] - q[i + 1], q[j + 2] - q[i + 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length > LOST_LENGTH * rest_length[s]:
            inverse = 1.0 / length
            nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
        else:
            nx, ny, nz = rest_axis[s, 0], rest_axis[s, 1], rest_axis[s, 2]
        stretch_rate = nx * (u[j] - u[i]) + ny * (u[j + 1] - u[i + 1]) + nz * (u[j + 2] - u[i + 2])
        tension = k[s] * (length - rest_length[s]) + c[s] * stretch_rate
        fx, fy, fz = tension * nx, tension * ny, tension * nz
        force[i] += fx
        force[i + 1] += fy
        force[i + 2] += fz
        force[j] -= fx
        force[j + 1] -= fy
        force[j + 2] -= fz


@compiled
def _fill_jacobian_loop(  # type: ignore[no-untyped-def]
    q, u, a, b, rest_length, rest_axis, k, c, positive_definite, corotated, n_nodes, by_position, by_rate
):
    n_springs = a.size
    n, rate, across = np.empty(3), np.empty(3), np.empty(3)
    for s in range(n_springs):
        i, j = a[s], b[s]
        square = 0.0
        for r in range(3):
            n[r] = q[3 * j + r] - q[3 * i + r]
            rate[r] = u[3 * j + r] - u[3 * i + r]
            square += n[r] * n[r]
        length = math.sqrt(square)
        lost = length <= LOST_LENGTH * rest_length[s]
        stretch_rate = 0.0
        for r in range(3):
            n[r] = rest_axis[s, r] if lost else n[r] / length
            stretch_rate += n[r] * rate[r]
        tension = k[s] * (length - rest_length[s]) + c[s] * stretch_rate
        # D = k n n^T + T / L (1 - n n^T) + c / L n v_across^T, the derivative of T n by x_b.
        pull = 0.0 if lost or corotated else tension / length
        rotary_damper = 0.0 if lost or positive_definite or corotated else c[s] / length
        if positive_definite:
            pull = max(pull, 0.0)
        for r in range(3):
            across[r] = rate[r] - stretch_rate * n[r]
        for r in range(3):
            for t in range(3):
                square_n = n[r] * n[t]
                stiff = k[s] * square_n - pull * square_n + rotary_damper * n[r] * across[t]
                if r == t:
                    stiff += pull
                damp = c[s] * square_n
                # Blocks: one a node, then (a, b) and (b, a) a spring.
                by_position[i, r, t] -= stiff
                by_position[j, r, t] -= stiff
                by_position[n_nodes + s, r, t] = stiff
                by_position[n_nodes + n_springs + s, r, t] = stiff
                by_rate[i, r, t] -= damp
                by_rate[j, r, t] -= damp
                by_rate[n_nodes + s, r, t] = damp
                by_rate[n_nodes + n_springs + s, r, t] = damp


@compiled
def add_stiffness(q, a, b, rest_length, rest_axis, weight, slots, matrix):  # type: ignore[no-untyped-def]
    """Add weight n n^T of every spring to the symmetric matrix of the nodes, without a list of entries between.

    Args:
        q: Coordinates [m].
        a, b, rest_length, rest_axis: The springs.
        weight: Of each spring, shape (n_springs,).
        slots: Places in the matrix of the lower halves of the blocks (a, a) and (b, b), row by row, and of the block
            (a, b), shape (n_springs, 21); -1 for an entry that the matrix has not.
        matrix: Values at their slots.
    """
    n = np.empty(3)
    for s in range(a.size):
        square = 0.0
        for r in range(3):
            n[r] = q[3 * b[s] + r] - q[3 * a[s] + r]
            square += n[r] * n[r]
        length = math.sqrt(square)
        if length > LOST_LENGTH * rest_length[s]:
            for r in range(3):
                n[r] /= length
        else:
            n[:] = rest_axis[s]
        k = 0
        for r in range(3):
            for t in range(r + 1):
                value = weight[s] * n[r] * n[t]
                if slots[s, k] >= 0:
                    matrix[slots[s, k]] += value
                if slots[s, 6 + k] >= 0:
                    matrix[slots[s, 6 + k]] += value
                k += 1
        for r in range(3):
            for t in range(3):
                slot = slots[s, 12 + 3 * r + t]
                if slot >= 0:
                    matrix[slot] -= weight[s] * n[r] * n[t]


def _axes(q, a, b, rest_length, rest_axis):  # type: ignore[no-untyped-def]
    x = q[: 3 * (b.max() + 1)].reshape(-1, 3)
    d = x[b] - x[a]
    length = np.sqrt(np.einsum("ij,ij->i", d, d))
    lost = length <= LOST_LENGTH * rest_length
    n = np.where(lost[:, None], rest_axis, d / np.where(lost, 1.0, length)[:, None])
    return n, length, lost


def _add_force_whole(q, u, a, b, rest_length, rest_axis, k, c, force):  # type: ignore[no-untyped-def]
    n, length, _ = _axes(q, a, b, rest_length, rest_axis)
    v = u[: 3 * (b.max() + 1)].reshape(-1, 3)
    tension = k * (length - rest_length) + c * np.einsum("ij,ij->i", n, v[b] - v[a])
    pull = tension[:, None] * n
    whole = force[: 3 * (b.max() + 1)].reshape(-1, 3)  # the last node is the far end of a spring
    for axis in range(3):
        whole[:, axis] += np.bincount(a, pull[:, axis], len(whole)) - np.bincount(
            b, pull[:, axis], len(whole)
        )


def _fill_jacobian_whole(  # type: ignore[no-untyped-def]
    q, u, a, b, rest_length, rest_axis, k, c, positive_definite, corotated, n_nodes, by_position, by_rate
):
    n, length, lost = _axes(q, a, b, rest_length, rest_axis)
    v = u[: 3 * n_nodes].reshape(-1, 3)
    rate = v[b] - v[a]
    stretch_rate = np.einsum("ij,ij->i", n, rate)
    safe = np.where(lost, 1.0, length)
    pull = np.where(lost | corotated, 0.0, (k * (length - rest_length) + c * stretch_rate) / safe)
    rotary_damper = np.where(lost | positive_definite | corotated, 0.0, c / safe)
    if positive_definite:
        pull = np.maximum(pull, 0.0)
    along = n[:, :, None] * n[:, None, :]
    across = rate - stretch_rate[:, None] * n
    stiff = (
        (k - pull)[:, None, None] * along
        + pull[:, None, None] * np.eye(3)
        + rotary_damper[:, None, None] * n[:, :, None] * across[:, None, :]
    )
    for values, block in ((by_position, stiff), (by_rate, c[:, None, None] * along)):
        values[n_nodes : n_nodes + len(a)] = block
        values[n_nodes + len(a) :] = block
        for r in range(3):
            for t in range(3):
                both = np.bincount(a, block[:, r, t], n_nodes) + np.bincount(b, block[:, r, t], n_nodes)
                values[:n_nodes, r, t] = -both


add_force = _add_force_loop if HAVE_NUMBA else _add_force_whole
fill_jacobian = _fill_jacobian_loop if HAVE_NUMBA else _fill_jacobian_whole

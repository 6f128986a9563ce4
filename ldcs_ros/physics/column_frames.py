"""The rotation of each column of the lattice (a bottom and a top node), from the tangents of the sheet."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.physics.compiled import compiled


@compiled
def fill_column_frames(x, neighbours, frames):  # type: ignore[no-untyped-def]
    """Write the axes of each column's frame as columns, shape (n, 3, 3), from node positions [m], shape (2 n, 3).

    The normal points from the bottom to the top node: springs along it are the stiffest of a fine lattice. Tangents
    along x and y are differences of both layers between the columns that `neighbours` names, shape (n, 4): ahead and
    before along x, then along y; central ones inside, one-sided at edges and holes. They are made perpendicular to
    the normal.
    The other two axes lie halfway between the tangents, so that shear favours neither. A column whose tangents or
    normal have no direction gets the axes of ldcs_base.
    """
    layer = len(neighbours)
    along, across, normal = np.empty(3), np.empty(3), np.empty(3)
    for k in range(layer):
        # The bottom node of column k is node k, and its top node has the same number after a whole layer.
        ahead, before, left, right = neighbours[k]
        square = slope_along = slope_across = 0.0
        for r in range(3):
            along[r] = x[ahead, r] + x[layer + ahead, r] - x[before, r] - x[layer + before, r]
            across[r] = x[left, r] + x[layer + left, r] - x[right, r] - x[layer + right, r]
            normal[r] = x[layer + k, r] - x[k, r]
            square += normal[r] ** 2
            slope_along += along[r] * normal[r]
            slope_across += across[r] * normal[r]
        square_along = square_across = product = 0.0
        for r in range(3):
            along[r] -= slope_along / square * normal[r]
            across[r] -= slope_across / square * normal[r]
            square_along += along[r] ** 2
            square_across += across[r] ** 2
            product += along[r] * across[r]
        frame = frames[k]
        # Not a number where top and bottom coincide.
        if not square_along * square_across - product**2 > 1e-12 * square_along * square_across:
            for r in range(3):
                for t in range(3):
                    frame[r, t] = 1.0 if r == t else 0.0
            continue
        # Of unit tangents a and b, a + b and a - b are perpendicular; both axes lie at 45 degrees to them.
        sum_square = difference_square = 0.0
        for r in range(3):
            along[r] /= math.sqrt(square_along)
            across[r] /= math.sqrt(square_across)
            sum_square += (along[r] + across[r]) ** 2
            difference_square += (along[r] - across[r]) ** 2
        for r in range(3):
            half_sum = (along[r] + across[r]) / math.sqrt(2.0 * sum_square)
            half_difference = (along[r] - across[r]) / math.sqrt(2.0 * difference_square)
            frame[r, 0] = half_sum + half_difference
            frame[r, 1] = half_sum - half_difference
            frame[r, 2] = normal[r] / math.sqrt(square)


@compiled
def rotated_vectors(rotation, values, back):  # type: ignore[no-untyped-def]
    """Return rotation[k] v_k (or with `back` its transpose) for every k, shapes (n, 3, 3) and (3 n,)."""
    out = np.empty(values.size)
    for k in range(len(rotation)):
        for r in range(3):
            total = 0.0
            for t in range(3):
                total += (rotation[k, t, r] if back else rotation[k, r, t]) * values[3 * k + t]
            out[3 * k + r] = total
    return out


@compiled
def rotated_columns(rotation, values, back):  # type: ignore[no-untyped-def]
    """Return the same as `rotated_vectors` for each column of values, shape (3 n, k)."""
    out = np.zeros(values.shape)
    for k in range(len(rotation)):
        for r in range(3):
            for t in range(3):
                factor = rotation[k, t, r] if back else rotation[k, r, t]
                for c in range(values.shape[1]):
                    out[3 * k + r, c] += factor * values[3 * k + t, c]
    return out


@compiled
def fill_rotations(now, then, columns, rotation):  # type: ignore[no-untyped-def]
    """Write the rotation from frames `then` to frames `now` for each of the columns, shape (n, 3, 3)."""
    for k in range(columns.size):
        a, b = now[columns[k]], then[columns[k]]
        for r in range(3):
            for t in range(3):
                rotation[k, r, t] = a[r, 0] * b[t, 0] + a[r, 1] * b[t, 1] + a[r, 2] * b[t, 2]

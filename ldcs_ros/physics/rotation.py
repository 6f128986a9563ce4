"""The rotation that fits best between two small sets of vectors, and other 3 x 3 kernels."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.compiled import compiled


@compiled
def best_rotation(m, rotation):  # type: ignore[no-untyped-def]
    """Write the proper rotation R that maximises tr(R^T m), m = sum w r d^T: R d is the best fit to r.

    Horn (1987): the unit quaternion is the eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix;
    here by cyclic Jacobi rotations. It exists for every m, also for mirrored or flattened sets.
    """
    n = np.empty((4, 4))
    n[0, 0] = m[0, 0] + m[1, 1] + m[2, 2]
    n[1, 1] = m[0, 0] - m[1, 1] - m[2, 2]
    n[2, 2] = m[1, 1] - m[0, 0] - m[2, 2]
    n[3, 3] = m[2, 2] - m[0, 0] - m[1, 1]
    n[0, 1] = n[1, 0] = m[2, 1] - m[1, 2]
    n[0, 2] = n[2, 0] = m[0, 2] - m[2, 0]
    n[0, 3] = n[3, 0] = m[1, 0] - m[0, 1]
    n[1, 2] = n[2, 1] = m[1, 0] + m[0, 1]
    n[1, 3] = n[3, 1] = m[2, 0] + m[0, 2]
    n[2, 3] = n[3, 2] = m[2, 1] + m[1, 2]
    vectors = np.eye(4)
    for _ in range(12):
        off = diagonal = 0.0
        for p in range(4):
            diagonal += n[p, p] ** 2
            for r in range(p + 1, 4):
                off += n[p, r] ** 2
        if off <= 1e-32 * diagonal:
            break
        for p in range(3):
            for r in range(p + 1, 4):
                if n[p, r] != 0.0:
                    theta = 0.5 * (n[r, r] - n[p, p]) / n[p, r]
                    t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                    if theta < 0.0:
                        t = -t
                    cosine = 1.0 / np.sqrt(t * t + 1.0)
                    sine = t * cosine
                    for k in range(4):
                        first, second = n[k, p], n[k, r]
                        n[k, p], n[k, r] = cosine * first - sine * second, sine * first + cosine * second
                    for k in range(4):
                        first, second = n[p, k], n[r, k]
                        n[p, k], n[r, k] = cosine * first - sine * second, sine * first + cosine * second
                    for k in range(4):
                        first, second = vectors[k, p], vectors[k, r]
                        vectors[k, p], vectors[k, r] = (
                            cosine * first - sine * second,
                            sine * first + cosine * second,
                        )
    largest = 0
    for p in range(1, 4):
        if n[p, p] > n[largest, largest]:
            largest = p
    w, x, y, z = vectors[0, largest], vectors[1, largest], vectors[2, largest], vectors[3, largest]
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
    )
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = (
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
    )
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = (
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )


@compiled
def inverse(m, out):  # type: ignore[no-untyped-def]
    """Write the inverse of a symmetric 3 x 3 matrix, by cofactors; 1e-12 of its trace keeps it regular.

    The inverse of nothing is nothing: the least answer for a star whose nodes are all in one point.
    """
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    if not abs(trace) > 1e-90:
        out[:, :] = 0.0
        return
    shift = 1e-12 * trace
    a, b, c = m[0, 0] + shift, m[1, 1] + shift, m[2, 2] + shift
    d, e, f = m[0, 1], m[0, 2], m[1, 2]
    out[0, 0] = b * c - f * f
    out[0, 1] = out[1, 0] = e * f - d * c
    out[0, 2] = out[2, 0] = d * f - e * b
    out[1, 1] = a * c - e * e
    out[1, 2] = out[2, 1] = d * e - a * f
    out[2, 2] = a * b - d * d
    determinant = a * out[0, 0] + d * out[0, 1] + e * out[0, 2]
    out /= determinant


@compiled
def fill_cross(v, scale, out):  # type: ignore[no-untyped-def]
    """Write the matrix that multiplies like scale * (v x .)."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2] = -scale * v[2], scale * v[1]
    out[1, 0], out[1, 2] = scale * v[2], -scale * v[0]
    out[2, 0], out[2, 1] = -scale * v[1], scale * v[0]

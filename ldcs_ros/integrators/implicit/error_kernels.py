"""The vector work of `ErrorTransport`: the quintic inside a step, errors in turning axes, distances of nodes."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.physics.compiled import compiled

# Lobatto's inner points; with their weight 5/12 and zero ends, polynomials of degree five are integrated exactly.
INNER = 0.5 - 0.1 * math.sqrt(5.0), 0.5 + 0.1 * math.sqrt(5.0)
INNER_WEIGHT = 5.0 / 12.0
# Each stage of the transport linearises the motion at the first or second inner point or at the end of the step.
STAGE_PLACES = 0, 1, 0, 1, 2


@compiled
def interpolate(free, h, s, q0, u0, a0, q1, u1, a1, q, u, a):  # type: ignore[no-untyped-def]
    """Write the quintic through both ends at the fraction s of a step: q and u at the free coordinates, and a."""
    for i in range(free.size):
        k = free[i]
        r0, r1, b0, b1 = h * u0[k], h * u1[k], h * h * a0[i], h * h * a1[i]
        gap, rate, bend = q1[k] - q0[k] - r0 - 0.5 * b0, r1 - r0 - b0, b1 - b0
        c3 = 10.0 * gap - 4.0 * rate + 0.5 * bend
        c4 = -15.0 * gap + 7.0 * rate - bend
        c5 = 6.0 * gap - 3.0 * rate + 0.5 * bend
        q[k] = q0[k] + s * (r0 + s * (0.5 * b0 + s * (c3 + s * (c4 + s * c5))))
        u[k] = (r0 + s * (b0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h
        a[i] = (b0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h)


@compiled
def column_spins(now, then, columns, h, spin):  # type: ignore[no-untyped-def]
    """Write the angular velocity [rad/s] that turns each frame `then` into `now` in h [s]; return the largest angle."""
    most = 0.0
    for k in range(columns.size):
        a, b = now[columns[k]], then[columns[k]]
        x = y = z = trace = 0.0
        for t in range(3):
            for r in range(3):
                trace += a[r, t] * b[r, t]
            x += a[2, t] * b[1, t] - a[1, t] * b[2, t]
            y += a[0, t] * b[2, t] - a[2, t] * b[0, t]
            z += a[1, t] * b[0, t] - a[0, t] * b[1, t]
        sine = 0.5 * math.sqrt(x * x + y * y + z * z)
        angle = math.atan2(sine, 0.5 * (trace - 1.0))
        most = max(most, angle)
        scale = 0.5 * (angle / sine if sine > 1e-9 else 1.0) / h
        spin[k, 0], spin[k, 1], spin[k, 2] = scale * x, scale * y, scale * z
    return most


@compiled
def _rotated(spin, time, x, y, z):  # type: ignore[no-untyped-def]
    """Return (x, y, z) after a time [s] of a constant angular velocity [rad/s], by Rodrigues' formula."""
    rate = math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    if rate == 0.0:
        return x, y, z
    nx, ny, nz = spin[0] / rate, spin[1] / rate, spin[2] / rate
    c, s = math.cos(rate * time), math.sin(rate * time)
    along = (1.0 - c) * (nx * x + ny * y + nz * z)
    return (
        c * x + s * (ny * z - nz * y) + along * nx,
        c * y + s * (nz * x - nx * z) + along * ny,
        c * z + s * (nx * y - ny * x) + along * nz,
    )


@compiled
def rotate_vectors(order, spin, time, values):  # type: ignore[no-untyped-def]
    """Rotate each node's vector by its angular velocity for a time [s], in place; a negative time rotates it back."""
    for k in range(len(spin)):
        i, j, m = order[3 * k], order[3 * k + 1], order[3 * k + 2]
        values[i], values[j], values[m] = _rotated(spin[k], time, values[i], values[j], values[m])


@compiled
def subtract_spin(order, spin, q, u):  # type: ignore[no-untyped-def]
    """Subtract spin x q from each node's rate u, in place: the rate of q as seen in the turning axes."""
    for k in range(len(spin)):
        w = spin[k]
        i, j, m = order[3 * k], order[3 * k + 1], order[3 * k + 2]
        u[i] -= w[1] * q[m] - w[2] * q[j]
        u[j] -= w[2] * q[i] - w[0] * q[m]
        u[m] -= w[0] * q[j] - w[1] * q[i]


@compiled
def moments(first, second, moment, mean, slope):  # type: ignore[no-untyped-def]
    """Write mean and slope of the linear forcing that has the mean and first moment of residuals at INNER.

    `moment` is what the stages take for the first moment of the time in the step; that of 1 is 1/2.
    """
    for i in range(first.size):
        mean[i] = INNER_WEIGHT * (first[i] + second[i])
        whole = INNER_WEIGHT * ((1.0 - INNER[0]) * first[i] + (1.0 - INNER[1]) * second[i])
        slope[i] = (whole - 0.5 * mean[i]) / (moment - 0.25)


@compiled
def known_part(a, stage, h, e_q, e_u, errors, known):  # type: ignore[no-untyped-def]
    """Write what start and stages before give a stage: position and rate of its error, shape (2, n)."""
    for i in range(e_q.size):
        known[0, i], known[1, i] = e_q[i], e_u[i]
    for k in range(stage):
        for i in range(e_q.size):
            known[0, i] += h * a[stage, k] * errors[k, 1, i]
            known[1, i] += h * a[stage, k] * errors[k, 2, i]


@compiled
def finish_stage(stage, rate_step, a, known, errors):  # type: ignore[no-untyped-def]
    """Write a stage's error (position, rate, acceleration) from its known part and its acceleration."""
    for i in range(a.size):
        rate = known[1, i] + rate_step * a[i]
        errors[stage, 0, i] = known[0, i] + rate_step * rate
        errors[stage, 1, i] = rate
        errors[stage, 2, i] = a[i]


@compiled
def largest_bulge(free, n, c, start, errors):  # type: ignore[no-untyped-def]
    """Return the largest distance of a node [m] at the first two stages, their bulge over the chord counted twice."""
    most = 0.0
    for k in range(2):
        square, node = 0.0, -1
        for i in range(n):
            if free[i] // 3 != node:
                node, square = free[i] // 3, 0.0
            chord = (1.0 - c[k]) * start[i] + c[k] * errors[-1, 0, i]
            square += (2.0 * errors[k, 0, i] - chord) ** 2
            most = max(most, square)
    return math.sqrt(most)


@compiled
def apply_stage(free, order, spin, time, rate_step, mass, known, q, u, force):  # type: ignore[no-untyped-def]
    """Add a stage's error without its own acceleration to q and u; subtract M times the apparent one from a force.

    In axes that turn with w, v = e' + w x e is the velocity in fixed axes and w x (e' + v) the acceleration.
    """
    n_rotating, known_q, known_u = 3 * len(spin), known[0], known[1]
    for k in range(len(spin)):
        w = spin[k]
        i, j, m = order[3 * k], order[3 * k + 1], order[3 * k + 2]
        x, y, z = (
            known_q[i] + rate_step * known_u[i],
            known_q[j] + rate_step * known_u[j],
            known_q[m] + rate_step * known_u[m],
        )
        vx = known_u[i] + w[1] * z - w[2] * y
        vy = known_u[j] + w[2] * x - w[0] * z
        vz = known_u[m] + w[0] * y - w[1] * x
        sx, sy, sz = known_u[i] + vx, known_u[j] + vy, known_u[m] + vz
        ax, ay, az = w[1] * sz - w[2] * sy, w[2] * sx - w[0] * sz, w[0] * sy - w[1] * sx
        x, y, z = _rotated(w, time, x, y, z)
        vx, vy, vz = _rotated(w, time, vx, vy, vz)
        ax, ay, az = _rotated(w, time, ax, ay, az)
        q[free[i]] += x
        q[free[j]] += y
        q[free[m]] += z
        u[free[i]] += vx
        u[free[j]] += vy
        u[free[m]] += vz
        force[i] -= mass[i] * ax
        force[j] -= mass[j] * ay
        force[m] -= mass[m] * az
    # Without turning axes all coordinates are left, with them the arms' angles.
    for i in range(n_rotating, free.size):
        q[free[i]] += known_q[i] + rate_step * known_u[i]
        u[free[i]] += known_u[i]


@compiled
def largest_distance(free, values, n):  # type: ignore[no-untyped-def]
    """Return the largest Euclidean length of a node's vector; values hold the n free node coordinates first."""
    most = square = 0.0
    node = -1
    for i in range(n):
        if free[i] // 3 != node:
            node, square = free[i] // 3, 0.0
        square += values[i] ** 2
        if not square < np.inf:
            return np.inf
        most = max(most, square)
    return math.sqrt(most)


@compiled
def embedded_error(h, weights, rates, accelerations, reach, rate_fraction, defect, rate_defect):  # type: ignore[no-untyped-def]
    """Write the differences of a step from the embedded solution; return its error [m] and that of its rates [m/s].

    Args:
        h: The step [s].
        weights: The tableau's `error_weights`.
        rates, accelerations: Of start and stages, shape (n_stages, n_free).
        reach: Displacement of a node for a coordinate's unit.
        rate_fraction: An error h du in a rate counts as this fraction of it in a position.
        defect, rate_defect: Become the differences of positions and rates, shape (n_free,).
    """
    most = most_rate = 0.0
    for i in range(defect.size):
        position = rate = 0.0
        for k in range(weights.size):
            position += weights[k] * rates[k, i]
            rate += weights[k] * accelerations[k, i]
        defect[i], rate_defect[i] = h * position, h * rate
        size, rate_size = abs(defect[i]) * reach[i], abs(rate_defect[i]) * reach[i]
        if not size + rate_size < np.inf:
            return np.inf, np.inf
        most, most_rate = max(most, size, rate_fraction * h * rate_size), max(most_rate, rate_size)
    return most, most_rate

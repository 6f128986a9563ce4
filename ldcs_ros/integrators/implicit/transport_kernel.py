"""The transport of a run's error over a step as one compiled function, for scenes that the compiled force covers."""

from __future__ import annotations

import numpy as np

from ldcs_ros.integrators.implicit.bordered_kernel import fill_residual, times_mass
from ldcs_ros.integrators.implicit.dirk_kernel import solve_turned
from ldcs_ros.integrators.implicit.error_kernels import (
    INNER,
    STAGE_PLACES,
    apply_stage,
    column_spins,
    finish_stage,
    interpolate,
    known_part,
    largest_bulge,
    largest_distance,
    moments,
    rotate_vectors,
)
from ldcs_ros.physics import arm
from ldcs_ros.physics.column_frames import fill_column_frames
from ldcs_ros.physics.compiled import compiled


@compiled
def _column_spin(factors, sheet, h, q0, q1):  # type: ignore[no-untyped-def]
    # As `ErrorTransport._column_spin`.
    spin, nodes = np.empty((factors.columns.size, 3)), 3 * sheet.scratch.shape[1]
    if factors.columns.size == 0:
        return 0.0, spin
    then, now = np.empty(factors.frames.shape), np.empty(factors.frames.shape)
    fill_column_frames(q0[:nodes].reshape(-1, 3), factors.neighbours, then)
    fill_column_frames(q1[:nodes].reshape(-1, 3), factors.neighbours, now)
    return column_spins(now, then, factors.columns, h, spin), spin


@compiled
def _fill_inertia(sheet, q):  # type: ignore[no-untyped-def]
    if sheet.inertia.shape[0] > 0:
        first, links = 3 * sheet.scratch.shape[1], sheet.inertia.shape[1]
        arm.fill_inertia(
            q[first:].reshape(-1, links), sheet.force.arms.arms, sheet.force.arms.links, sheet.inertia
        )


@compiled
def carry_error(  # type: ignore[no-untyped-def]
    sheet,
    factors,
    a,
    c,
    moment,
    h,
    rate_step,
    turns,
    drive,
    steady,
    first,
    start_q,
    start_u,
    end_a,
    q,
    u,
    e_q,
    e_u,
    carried,
):
    """Carry an error of a held sheet over a step, as `ErrorTransport` does it piece by piece.

    Args:
        sheet, factors: `SheetTables` and `BandTables`.
        a, c, moment: Coefficients, times and first moment of the stages.
        h, rate_step: The step and the factors' h [s].
        turns: Rotations of the columns at INNER and the end, shape (3, 2, n_columns, 3, 3).
        drive: Drive torques there [N m], shape (3, n_arms, n_links).
        steady: Constant forces.
        first: Acceleration at the start of the step.
        start_q, start_u, end_a: The step's start, and the acceleration at its end.
        q, u: Prescribed coordinates there; the last row is the end. The others change. Shape (3, n_coordinates).
        e_q, e_u: The error at the start, position and rate.
        carried: Becomes the error's position and rate at the end, shape (2, n_free).

    Returns:
        The largest distance inside the step [m] and speed [m/s], and the largest angle that a column turns [rad].
    """
    free, order, n_free = sheet.free, factors.order, sheet.free.size
    angle, column_spin = _column_spin(factors, sheet, h, start_q, q[2])
    no_spin = np.zeros((0, 3))
    residual, forces, force = np.empty((2, n_free)), np.empty((3, n_free)), np.empty(q.shape[1])
    acceleration, end_q, end_u = np.empty(n_free), q[2], u[2]
    for k in range(2):
        s = INNER[k]
        interpolate(free, h, s, start_q, start_u, first, end_q, end_u, end_a, q[k], u[k], acceleration)
        fill_residual(
            sheet.force, drive[k], steady, sheet.scratch, free, sheet.mass, q[k], u[k], acceleration,
            sheet.inertia, force, residual[k],
        )  # fmt: skip
        for i in range(n_free):
            forces[k, i] = force[free[i]]
        rotate_vectors(order, column_spin, -s * h, residual[k])
    forces[2] = end_a
    _fill_inertia(sheet, end_q)
    times_mass(sheet.inertia, sheet.mass, forces[2], sheet.mass.size)
    mean, slope = np.empty(n_free), np.empty(n_free)
    moments(residual[0], residual[1], moment, mean, slope)
    errors, known = np.empty((c.size, 3, n_free)), np.empty((2, n_free))
    right, still, x, v = residual[0], residual[1], np.empty(q.shape[1]), np.empty(q.shape[1])
    still[:] = 0.0
    for k in range(c.size):
        at = STAGE_PLACES[k]
        elapsed = h * (INNER[at] if at < 2 else 1.0)
        x[:], v[:] = q[at], u[at]
        known_part(a, k, h, e_q, e_u, errors, known)
        for i in range(n_free):
            acceleration[i] = mean[i] + (c[k] - 0.5) * slope[i]
        rotate_vectors(order, column_spin, elapsed, acceleration)
        apply_stage(free, order, no_spin, elapsed, rate_step, sheet.mass, known, x, v, acceleration)
        fill_residual(
            sheet.force, drive[at], steady, sheet.scratch, free, sheet.mass, x, v, still,
            sheet.inertia, force, right,
        )  # fmt: skip
        for i in range(n_free):
            right[i] += acceleration[i] - forces[at, i]
        solve_turned(factors, turns[at], 1.0, right)
        finish_stage(k, rate_step, right, known, errors)
    inside = largest_bulge(free, sheet.mass.size, c, e_q, errors)
    carried[0], carried[1] = errors[-1, 0], errors[-1, 1]
    speed = 0.0
    for k in range(c.size):
        speed = max(speed, largest_distance(free, errors[k, 1], sheet.mass.size))
    return inside, speed, angle

"""All steps of the two-step formula between two commands as one compiled loop, with the error that the run carries."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.integrators.implicit.bordered_kernel import (
    fill_both_rotations,
    fill_residual,
    solve_factors,
    times_mass,
)
from ldcs_ros.integrators.implicit.error_kernels import largest_distance
from ldcs_ros.physics import arm
from ldcs_ros.physics.compiled import compiled

# Rows of the numbers of a run of steps.
(
    BEGIN,
    LENGTH,
    FIRST,
    END,
    BEFORE,
    ALLOWED,
    FIRST_RATE,
    LATER_RATE,
    LAG,
    PATIENCE,
    SCALE,
    TURNING,
    TURNED,
) = range(13)
# Results: steps taken, iterations, first and later contraction rate, largest distance of the carried error [m],
# distance that nodes have moved since the last turn [m], reason for an early end.
DONE, ITERATIONS, FIRST_SEEN, LATER_SEEN, CARRIED, MOVED, REASON = range(7)
N_RESULTS = 7
SLOW, CONTACT = 1.0, 2.0
# An iteration that moves more than the one before it by this factor is given up.
WILD_RATE = 2.0
# No first rate below this is relied on: a good first guess must not end an iteration too soon.
LEAST_FIRST_RATE = 0.3


@compiled
def _count_contacts(at, contact, q):  # type: ignore[no-untyped-def]
    count = 0
    for c in range(at.size):
        if q[at[c]] < contact[0, c]:
            count += 1
    return count


@compiled
def advance(  # type: ignore[no-untyped-def]
    tables, drive, steady, scratch, free, factors, weights, numbers, motion, vectors, jump, rotations, results
):
    """Take steps of the two-step formula, in place, until a time is reached or one of them is not to be had.

    With h the step, w its ratio to the one before, b = (1 + w) / (1 + 2 w) h and c = w^2 / (1 + 2 w),

        u = u_n + c (u_n - u_(n-1)) + b A,    q = q_n + c (q_n - q_(n-1)) + b u,    M(q) A = f(t, q, u).

    The error e = (true motion) - (computed motion) obeys the same formula with the step's own error in its known part
    k_q, k_u, linearised: A_e = W^-1 (f(q + k_q + b k_u, u + k_u) - M A), which holds what the iteration left, too.

    Args:
        tables: `ForceTables`.
        drive: Drive torques, shape (4, n_arms, n_links): those that valves tend to [N m], how far off they are at a
            time [N m], that time [s], and time constants [s].
        steady: Constant forces on all coordinates.
        scratch: Room for the force.
        free: Free coordinates, nodes first.
        factors: `FactorTables`.
        weights: Masses of nodes, then reach of coordinates, shape (2, n_free).
        numbers: By the names above: begin of the row of steps, their length, number of the first and that after the
            last, length of the step before, allowed displacement, expected rates, tau, most iterations, factor on
            the solution, distance between turns, distance since the last turn.
        motion: q, u now and one step before, shape (4, n_coordinates).
        vectors: A of the formula one step before and now, e_q, e_u, and these one step before, shape (6, n_free).
        jump: That of the force at the begin, shape (n_free,), or (0,).
        rotations: Of the factors, shape (2, n_columns, 3, 3).
        results: By the names above.
    """
    n_free, n_nodes, n_all = free.size, factors.order.size, motion.shape[1]
    links, first = tables.arms.links.shape[1], 3 * scratch.shape[1]
    inertia = np.empty(((n_free - n_nodes) // links if n_free > n_nodes else 0, links, links))
    known, residual, force = np.empty((2, n_free)), np.empty(n_free), np.empty(n_all)
    q, u, a = np.empty(n_all), np.empty(n_all), np.empty(n_free)
    lasting, left, squared, torque = (
        np.zeros(n_free),
        np.zeros(n_free),
        np.zeros(n_free),
        np.empty(drive.shape[1:]),
    )
    h, before, tau, scale = numbers[LENGTH], numbers[BEFORE], numbers[LAG], numbers[SCALE]
    moved_since = numbers[TURNED]
    first_rate, later_rate = numbers[FIRST_RATE], numbers[LATER_RATE]
    results[:] = 0.0
    contacts = _count_contacts(tables.contact_at, tables.contact, motion[0])
    index = int(numbers[FIRST])
    while index < int(numbers[END]):
        time = numbers[BEGIN] + (index + 1) * h
        ratio = h / before
        rate_step, back = (1.0 + ratio) / (1.0 + 2.0 * ratio) * h, ratio * ratio / (1.0 + 2.0 * ratio)
        for side in range(torque.shape[0]):
            decay = math.exp(-(time - drive[2, side, 0]) / drive[3, side, 0])
            for k in range(links):
                torque[side, k] = drive[0, side, k] + drive[1, side, k] * decay
        q[:], u[:] = motion[0], motion[1]
        for i in range(n_free):
            k = free[i]
            known[0, i] = q[k] + back * (q[k] - motion[2, k])
            known[1, i] = u[k] + back * (u[k] - motion[3, k])
            a[i] = vectors[1, i] + ratio * (vectors[1, i] - vectors[0, i])
            u[k] = known[1, i] + rate_step * a[i]
            q[k] = known[0, i] + rate_step * u[k]
        if moved_since >= numbers[TURNING]:
            ahead = rate_step / (1.0 + rate_step / tau) if tau > 0.0 else 0.0
            fill_both_rotations(factors, scratch.shape[1], ahead, q, u, rotations)
            moved_since = 0.0
        if n_free > n_nodes:
            arm.fill_inertia(q[first:].reshape(-1, links), tables.arms.arms, tables.arms.links, inertia)
        if results[DONE] == 0.0 and jump.size > 0:
            # The formula answers a jump g of the acceleration by b R g with R = (1 - b A)^-1, the motion by
            # h phi_1(h A) g. alpha R + beta R^2 makes up for the difference, to first order in h A and for stiff parts.
            # The b of R is that of kept factors. They have no scale: one above 1 would let the impulse that free motion
            # takes up grow.
            lasting[:] = jump
            solve_factors(factors, rotations, 1.0, lasting)
            squared[:] = lasting
            times_mass(inertia, weights[0], squared, n_nodes)
            solve_factors(factors, rotations, 1.0, squared)
            missing = ratio / (1.0 + 2.0 * ratio)
            slope = -0.5 * h / ((1.0 + 2.0 * ratio) * factors.rate_step)
            kept = h / factors.rate_step
            alpha, beta = h * (2.0 * missing - slope), h * (slope - missing)
            for i in range(n_free):
                impulse = alpha * lasting[i] + beta * squared[i]
                # What is left of it at the end of the step, exp(h A) g to first order.
                left[i] = (2.0 - kept) * lasting[i] + (kept - 1.0) * squared[i]
                known[0, i] += rate_step * (impulse + beta * lasting[i])
                known[1, i] += impulse
                a[i] += lasting[i]
                u[free[i]] = known[1, i] + rate_step * a[i]
                q[free[i]] = known[0, i] + rate_step * u[free[i]]
        elif results[DONE] == 1.0:
            lasting[:] = 0.0
            left[:] = 0.0
        moved, rate, done = 0.0, first_rate, False
        for iteration in range(int(numbers[PATIENCE])):
            fill_residual(
                tables, torque, steady, scratch, free, weights[0], q, u, a, inertia, force, residual
            )
            solve_factors(factors, rotations, scale, residual)
            last, moved = moved, 0.0
            for i in range(n_free):
                size = abs(residual[i]) * weights[1, i]
                if not size < np.inf:
                    moved = np.inf
                    break
                moved = max(moved, size)
                a[i] += residual[i]
                u[free[i]] = known[1, i] + rate_step * a[i]
                q[free[i]] = known[0, i] + rate_step * u[free[i]]
            results[ITERATIONS] += 1.0
            moved *= rate_step * rate_step
            if iteration == 1:
                first_rate = max(LEAST_FIRST_RATE, moved / last if last > 0.0 else 0.0)
                rate = max(first_rate, later_rate)
            elif iteration > 1:
                later_rate = rate = moved / last if last > 0.0 else 0.0
            if not (moved < np.inf and (iteration == 0 or rate < WILD_RATE)):
                break
            if moved == 0.0 or (rate < 1.0 and moved * rate / (1.0 - rate) <= numbers[ALLOWED]):
                done = True
                break
        results[FIRST_SEEN], results[LATER_SEEN] = first_rate, later_rate
        if not done:
            results[REASON] = SLOW
            break
        if _count_contacts(tables.contact_at, tables.contact, q) != contacts:
            results[REASON] = CONTACT
            break
        # The formula's own error is -C h^3 y''' (Hairer, Norsett and Wanner, section III.5); M u''' = K a + C q''' and
        # the drive's second derivative. Differences of accelerations for u''' would leave stiff parts a lasting error.
        constant = (1.0 + ratio) ** 2 / (6.0 * ratio * (1.0 + 2.0 * ratio)) * h * h
        for side in range(torque.shape[0]):
            bend = math.exp(-(time - drive[2, side, 0]) / drive[3, side, 0]) / drive[3, side, 0] ** 2
            for k in range(links):
                torque[side, k] -= constant * h / rate_step * drive[1, side, k] * bend
        most = 0.0
        motion[2:4] = motion[0:2]
        motion[0], motion[1] = q, u
        for i in range(n_free):
            made = -constant * (a[i] - vectors[1, i] - left[i])
            known[0, i] = vectors[2, i] + back * (vectors[2, i] - vectors[4, i]) + made
            known[1, i] = vectors[3, i] + back * (vectors[3, i] - vectors[5, i])
            vectors[0, i], vectors[1, i] = vectors[1, i] + lasting[i], a[i]
            most = max(most, abs(u[free[i]]) * weights[1, i])
            u[free[i]] += known[1, i] + made / rate_step
            q[free[i]] += known[0, i] + rate_step * known[1, i] - constant * h / rate_step * a[i]
        fill_residual(tables, torque, steady, scratch, free, weights[0], q, u, a, inertia, force, residual)
        solve_factors(factors, rotations, min(scale, 1.0), residual)
        for i in range(n_free):
            vectors[4, i], vectors[5, i] = vectors[2, i], vectors[3, i]
            vectors[3, i] = known[1, i] + rate_step * residual[i]
            vectors[2, i] = known[0, i] + rate_step * vectors[3, i]
        results[CARRIED] = max(results[CARRIED], largest_distance(free, vectors[2], n_nodes))
        moved_since += h * most
        before = h
        index += 1
        results[DONE] += 1.0
    results[MOVED] = moved_since

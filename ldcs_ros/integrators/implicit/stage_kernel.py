"""A step of the two-step formula as one compiled function: prediction, iteration with kept factors, error."""

from __future__ import annotations

import numpy as np

from ldcs_ros.integrators.implicit.bordered_kernel import (
    factor_tables,
    fill_both_rotations,
    fill_residual,
    solve_factors,
    times_mass,
)
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics import arm
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.physics.model import Model, Motion

# Local error of a step of equal lengths, 2/9 h^3 y''' (Hairer, Norsett and Wanner, section III.2).
ERROR_CONSTANT = 2.0 / 9.0
# An error h du in a rate counts as this fraction of it in a position.
RATE_WEIGHT = 0.25
# An iteration that moves more than the one before it by this factor is given up.
WILD_RATE = 2.0


@compiled
def _step(  # type: ignore[no-untyped-def]
    tables,
    drive,
    steady,
    scratch,
    free,
    factors,
    weights,
    numbers,
    past_q,
    past_u,
    past_a,
    jump,
    a,
    q,
    u,
):
    # weights: masses of nodes, then reach of coordinates. numbers: step, step ratio, allowed displacement, contraction
    # rate to expect, most iterations, factor on the solution, time ahead of the second rotation,
    # error from which on the filter is worth its solve.
    # past_a: acceleration at the start of the last step and at its end. jump: that of the force where commands changed
    # at the start, free coordinates, or empty. q, u: start, become the end.
    # past_a becomes those of a course that had the jump before.
    h, ratio, allowed, rate, scale = numbers[0], numbers[1], numbers[2], numbers[3], numbers[5]
    rate_step, back = (1.0 + ratio) / (1.0 + 2.0 * ratio) * h, ratio * ratio / (1.0 + 2.0 * ratio)
    n_free, n_nodes = free.size, factors.order.size
    links, n_angles, first = tables.arms.links.shape[1], n_free - n_nodes, 3 * scratch.shape[1]
    inertia = np.empty((n_angles // links if n_angles > 0 else 0, links, links))
    known, residual, force = (
        np.empty((2, n_free)),
        np.empty(n_free),
        np.empty(q.size),
    )
    for i in range(n_free):
        k = free[i]
        known[0, i] = q[k] + back * (q[k] - past_q[k])
        known[1, i] = u[k] + back * (u[k] - past_u[k])
        a[i] = past_a[1, i] + ratio * (past_a[1, i] - past_a[0, i])
        u[k] = known[1, i] + rate_step * a[i]
        q[k] = known[0, i] + rate_step * u[k]
    turns = np.empty((2, factors.columns.size, 3, 3))
    fill_both_rotations(factors, scratch.shape[1], numbers[6], q, u, turns)
    # The formula answers a jump g of the acceleration by b h R g with R = (1 - b h A)^-1, the motion by h phi_1(h A) g.
    # alpha R + beta R^2 makes up for the difference, to first order in h A and for stiff parts. Without a factor on the
    # solution, which would scale the impulse that free motion takes up.
    lasting = np.zeros(n_free)
    if jump.size > 0:
        lasting[:] = jump
        solve_factors(factors, turns, 1.0, lasting)
        residual[:] = lasting
        if n_angles > 0:
            arm.fill_inertia(q[first:].reshape(-1, links), tables.arms.arms, tables.arms.links, inertia)
        times_mass(inertia, weights[0], residual, n_nodes)
        solve_factors(factors, turns, 1.0, residual)
        missing = ratio / (1.0 + 2.0 * ratio)
        slope = -0.5 * h / ((1.0 + 2.0 * ratio) * rate_step)
        alpha, beta = h * (2.0 * missing - slope), h * (slope - missing)
        for i in range(n_free):
            impulse = alpha * lasting[i] + beta * residual[i]
            known[0, i] += rate_step * (impulse + beta * lasting[i])
            known[1, i] += impulse
            past_a[0, i] += lasting[i]
            past_a[1, i] += lasting[i]
            a[i] += lasting[i]
            u[free[i]] = known[1, i] + rate_step * a[i]
            q[free[i]] = known[0, i] + rate_step * u[free[i]]
    worst, before = 0.0, np.inf
    for iteration in range(int(numbers[4])):
        fill_residual(tables, drive, steady, scratch, free, weights[0], q, u, a, inertia, force, residual)
        solve_factors(factors, turns, scale, residual)
        moved = 0.0
        for i in range(n_free):
            size = abs(residual[i]) * weights[1, i]
            if not size < np.inf:
                return -iteration - 1, np.inf, np.inf
            moved = max(moved, size)
            a[i] += residual[i]
            u[free[i]] = known[1, i] + rate_step * a[i]
            q[free[i]] = known[0, i] + rate_step * u[free[i]]
        moved *= rate_step * rate_step
        if iteration > 0:
            rate = moved / before if before > 0.0 else 0.0
            worst = max(worst, rate)
            if rate > WILD_RATE:
                break
        if moved == 0.0 or (rate < 1.0 and moved * rate / (1.0 - rate) <= allowed):
            factor = ERROR_CONSTANT * h * h
            error = 0.0
            for i in range(n_free):
                changed = a[i] - past_a[1, i]
                unforeseen = changed - ratio * (past_a[1, i] - past_a[0, i])
                error = max(error, factor * weights[1, i] * max(abs(changed), RATE_WEIGHT * abs(unforeseen)))
                residual[i] = factor * (changed + rate_step / h * unforeseen)
            if error > numbers[7]:
                # W^-1 M takes away what stiff parts have forgotten at the end of the step (Hairer and Wanner, IV.8).
                times_mass(inertia, weights[0], residual, n_nodes)
                solve_factors(factors, turns, scale, residual)
                filtered = 0.0
                for i in range(n_free):
                    filtered = max(filtered, weights[1, i] * abs(residual[i]))
                error = min(error, filtered)
            return iteration + 1, worst, error
        before = moved
    return -int(numbers[4]), worst, np.inf


class StageKernel:
    """The compiled step with the tables of one model."""

    def __init__(self, model: Model, force: TotalForce, system: LinearSystem) -> None:
        self.force, self.system, self._model = force, system, model
        n_free, n_nodes = len(model.free), model.n_free_nodes
        self._weights = np.ones((2, n_free))
        self._weights[0, :n_nodes] = model.mass
        self._weights[1, n_nodes:] = model.lattice.size[0]

    def step(
        self,
        factors: Factors,
        drive: np.ndarray,
        steady: np.ndarray,
        past: Motion,
        accelerations: np.ndarray,
        jump: np.ndarray,
        *,
        h: float,
        ratio: float,
        tolerance: float,
        allowed: float,
        rate: float,
        iterations: int,
        a: np.ndarray,
        q: np.ndarray,
        u: np.ndarray,
    ) -> tuple[int, float, float]:
        """Take a step of the two-step formula, in place.

        Args:
            factors: Kept factors with the storage `BlockTridiagonal`.
            drive: Drive torque of each joint [N m], shape (n_arms, n_links).
            steady: Constant forces on all coordinates [N, N m].
            past: The motion one step before.
            accelerations: Those of the formula there and at the start, shape (2, n_free); the jump is added.
            jump: That of the force on the free coordinates at the start, shape (n_free,), or (0,) without one.
            h: The step [s].
            ratio: h over the step before.
            tolerance: Error that the step may make [m].
            allowed: Displacement that the iteration may leave [m].
            rate: Contraction rate to expect until two iterations measured it.
            iterations: Iterations at most.
            a: Becomes the accelerations of the free coordinates.
            q: Coordinates at the start, prescribed ones at the end; become those at the end.
            u: Their rates.

        Returns:
            The number of iterations, negative if they did not converge, the worst contraction rate seen and the
            error estimate [m].
        """
        tau = self._model.relaxation_time
        rate_step = (1.0 + ratio) / (1.0 + 2.0 * ratio) * h
        ahead = rate_step / (1.0 + rate_step / tau) if tau else 0.0
        scale = self.system.rescaling(factors, rate_step)
        done, worst, error = _step(
            self.force.tables,
            drive,
            steady,
            self.force.scratch,
            self._model.free,
            factor_tables(self.system, factors),
            self._weights,
            np.array([h, ratio, allowed, rate, iterations, scale, ahead, tolerance]),
            past.q,
            past.u,
            accelerations,
            jump,
            a,
            q,
            u,
        )
        return int(done), float(worst), float(error)

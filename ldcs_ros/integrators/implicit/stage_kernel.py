"""A step of the two-step formula as one compiled function: prediction, iteration with kept factors, error."""

from __future__ import annotations

import numpy as np

from ldcs_ros.integrators.implicit.block_tridiagonal import BlockFactors, solve_blocks
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics import arm
from ldcs_ros.physics.column_frames import fill_column_frames, fill_rotations
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.kernels.total_force import TotalForce, add_total_force
from ldcs_ros.physics.model import Model, Motion

# Local error of a step of equal lengths, 2/9 h^3 y''' (Hairer, Norsett and Wanner, section III.2).
ERROR_CONSTANT = 2.0 / 9.0
# An error h du in a rate counts as this fraction of it in a position.
RATE_WEIGHT = 0.25
# An iteration that moves more than the one before it by this factor is given up.
WILD_RATE = 2.0


@compiled
def _solve(order, inverse, link, link_transposed, block, room, turns, border, corner, scale, right, nodes):  # type: ignore[no-untyped-def]
    # As `Factors.solve`: G^T, the blocks, the border of the arms, H; border[0] is B, border[1] is W^-1 B.
    n, n_angles = order.size, border.shape[2]
    turned = turns.shape[1] > 0
    for k in range(n // 3 if turned else 0):
        for r in range(3):
            total = 0.0
            for t in range(3):
                total += turns[0, k, t, r] * right[order[3 * k + t]]
            nodes[3 * k + r] = total
    for k in range(0 if turned else n):
        nodes[k] = right[order[k]]
    solve_blocks(inverse, link, link_transposed, block, room, nodes)
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
def _times_mass(inertia, mass, vector, n_nodes):  # type: ignore[no-untyped-def]
    # Replace a vector of free coordinates by M times it.
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
def _step(  # type: ignore[no-untyped-def]
    tables,
    drive,
    steady,
    scratch,
    free,
    order,
    columns,
    neighbours,
    then,
    inverse,
    link,
    link_transposed,
    block,
    room,
    border,
    corner,
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
    n_free, n_nodes = free.size, order.size
    links, n_angles, first = tables.arms.links.shape[1], border.shape[2], 3 * scratch.shape[1]
    inertia = np.empty((n_angles // links if n_angles > 0 else 0, links, links))
    nodes, known, residual, force = (
        np.empty(n_nodes),
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
    turns = np.empty((2, columns.size, 3, 3))
    if columns.size > 0:
        now = np.empty((len(neighbours), 3, 3))
        fill_column_frames(q[:first].reshape(-1, 3), neighbours, now)
        fill_rotations(now, then, columns, turns[0])
        fill_column_frames((q[:first] + numbers[6] * u[:first]).reshape(-1, 3), neighbours, now)
        fill_rotations(now, then, columns, turns[1])
    # The formula answers a jump g of the acceleration by b h R g with R = (1 - b h A)^-1, the motion by h phi_1(h A) g.
    # alpha R + beta R^2 makes up for the difference, to first order in h A and for stiff parts. Without a factor on the
    # solution, which would scale the impulse that free motion takes up.
    lasting = np.zeros(n_free)
    if jump.size > 0:
        lasting[:] = jump
        _solve(order, inverse, link, link_transposed, block, room, turns, border, corner, 1.0, lasting, nodes)
        residual[:] = lasting
        if n_angles > 0:
            arm.fill_inertia(q[first:].reshape(-1, links), tables.arms.arms, tables.arms.links, inertia)
        _times_mass(inertia, weights[0], residual, n_nodes)
        _solve(
            order, inverse, link, link_transposed, block, room, turns, border, corner, 1.0, residual, nodes
        )
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
        force[:] = steady
        add_total_force(tables, drive, q, u, scratch, force)
        for i in range(n_nodes):
            residual[i] = force[free[i]] - weights[0, i] * a[i]
        if n_angles > 0:
            phi = q[first:].reshape(-1, links)
            arm.fill_inertia(phi, tables.arms.arms, tables.arms.links, inertia)
            for side in range(inertia.shape[0]):
                for k in range(links):
                    total = force[first + side * links + k]
                    for m in range(links):
                        total -= inertia[side, k, m] * a[n_nodes + side * links + m]
                    residual[n_nodes + side * links + k] = total
        _solve(
            order, inverse, link, link_transposed, block, room, turns, border, corner, scale, residual, nodes
        )
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
                _times_mass(inertia, weights[0], residual, n_nodes)
                _solve(
                    order,
                    inverse,
                    link,
                    link_transposed,
                    block,
                    room,
                    turns,
                    border,
                    corner,
                    scale,
                    residual,
                    nodes,
                )
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
        self._columns = np.zeros(0, dtype=np.int64) if system.columns is None else system.columns

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
        blocks, border, reach, corner = factors.parts
        assert isinstance(blocks, BlockFactors)
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
            self.system.order,
            self._columns,
            self._model.lattice.column_neighbours,
            factors.frames,
            blocks.inverse,
            blocks.link,
            blocks.link_transposed,
            blocks.block,
            blocks.room,
            np.stack([border, reach]) if border.size else np.zeros((2, len(border), 0)),
            corner,
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

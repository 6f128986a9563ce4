"""Kernels with the tables of a scene, executed by Python on small sheets, against formulas of dense matrices.

`test_kernels.py` runs this file with NUMBA_DISABLE_JIT: no kernel is compiled for the arguments of a test.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from small_sheet import small_sheet

from ldcs_ros.integrators import base
from ldcs_ros.integrators.implicit import (
    bordered_kernel,
    command_kernel,
    dirk_kernel,
    stage_kernel,
)
from ldcs_ros.integrators.implicit.banded import Band
from ldcs_ros.integrators.implicit.block_tridiagonal import BlockTridiagonal
from ldcs_ros.integrators.implicit.command_formula import CommandFormula
from ldcs_ros.integrators.implicit.linear_kernel import LinearKernel
from ldcs_ros.integrators.implicit.linearisation import Linearisation
from ldcs_ros.integrators.implicit.nested_dissection import Dissection
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.kernels.manifold_step import fill_projection, manifold_step
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.scene import load_scene

ARMS = {"drive": "torque", "links": 2, "width": 0}
FLOOR = {"type": "floor", "height": -0.02}
DRAG = {"type": "drag"}


def sheet(*effects, nodes=(4, 3), arms=ARMS, **solver):
    return load_scene(small_sheet(*effects, nodes=nodes, arms=arms, solver=solver)).build()


def loose(**solver):
    content = small_sheet(nodes=(3, 3), solver=solver)
    content["effects"] = [effect for effect in content["effects"] if effect["type"] == "springs"]
    return load_scene(content).build()


def moved(simulation, seed=3):
    """Return a motion near the reference with random displacements, rates and accelerations."""
    model, random = simulation.model, np.random.default_rng(seed)
    q, u = model.reference_state()
    q[model.free] += 1e-3 * random.normal(size=len(model.free))
    u[model.free] += 0.1 * random.normal(size=len(model.free))
    return q, u, random


def dense_mass(model, q):
    blocks = model.inertia(q)
    return block_diag(np.diag(model.mass), *([] if blocks is None else blocks))


def dense_stage(model, q, u, held, h):
    """Return W = M - h C - h^2 K, made symmetric."""
    by_position, by_rate = model.jacobian(0.0, q, u, held, positive_definite=False)
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    matrix = np.zeros((len(model.free), len(model.free)))
    np.add.at(matrix, (rows[used], columns[used]), -h * (by_rate + h * by_position)[used])
    return 0.5 * (matrix + matrix.T) + dense_mass(model, q)


@pytest.mark.parametrize("nodes", [(4, 3), (3, 4), (4, 4), (5, 3)])
@pytest.mark.parametrize(
    ("storage", "accuracy"), [(Band, 1e-9), (BlockTridiagonal, 1e-3), (Dissection, 1e-3)]
)
def test_factors_solve_the_dense_matrix(nodes, storage, accuracy):
    simulation = sheet(nodes=nodes)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    factors = LinearSystem(model, storage).factor(0.0, q, u, held, 2e-3)
    right = random.normal(size=(len(model.free), 2))
    expected = np.linalg.solve(dense_stage(model, q, u, held, 2e-3), right)
    for solution in (factors.solve(right), np.stack([factors.solve(column) for column in right.T], axis=1)):
        assert np.abs(solution - expected).max() <= accuracy * np.abs(expected).max()


@pytest.mark.parametrize("nodes", [(8, 5), (11, 3)])
def test_a_dissection_with_several_fronts_solves_the_dense_matrix(nodes):
    simulation = sheet(nodes=nodes)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    system = LinearSystem(model, Dissection)
    factors = system.factor(0.0, q, u, held, 2e-3)
    assert len(factors.parts[0]._at.fronts) >= 3
    right = random.normal(size=len(model.free))
    expected = np.linalg.solve(dense_stage(model, q, u, held, 2e-3), right)
    assert np.abs(factors.solve(right) - expected).max() <= 1e-3 * np.abs(expected).max()


def test_compiled_solves_apply_rotations_border_and_scale():
    simulation = sheet(nodes=(4, 3))
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    for storage, tables, solve in (
        (Band, None, dirk_kernel.solve_turned),
        (BlockTridiagonal, bordered_kernel.factor_tables, bordered_kernel.solve_factors),
    ):
        system = LinearSystem(model, storage)
        factors = system.factor(0.0, q, u, held, 2e-3, corotated=True)
        if tables is None:
            kernel = dirk_kernel.DirkKernel(model, system, np.ones(len(model.free)))
            table = kernel.tables(factors)
        else:
            table = tables(system, factors)
        turns = Rotation.from_rotvec(random.normal(size=(2 * len(system.columns), 3))).as_matrix()
        for shape, scale in ((turns.reshape(2, -1, 3, 3), 1.0), (turns.reshape(2, -1, 3, 3), 0.7)):
            # W = G W0 H^T for the nodes, the arms' part in the same axes.
            g, h = (np.eye(len(model.free)) for _ in range(2))
            n = len(system.order)
            for matrix, blocks in ((g, shape[0]), (h, shape[1])):
                matrix[np.ix_(system.order, system.order)] = block_diag(*blocks)
                matrix[n:, n:] = np.eye(len(model.free) - n)
            right = random.normal(size=len(model.free))
            plain = h @ (scale * factors.solve(g.T @ right))
            solution = right.copy()
            solve(table, np.ascontiguousarray(shape), scale, solution)
            assert np.abs(solution - plain).max() <= 1e-5 * np.abs(plain).max()


def test_rotations_of_columns_follow_a_turned_sheet():
    simulation = sheet()
    model = simulation.model
    q, u, _ = moved(simulation)
    system = LinearSystem(model, BlockTridiagonal)
    factors = system.factor(0.0, q, u, simulation.inputs.held(), 2e-3, corotated=True)
    turn, spin = Rotation.from_rotvec([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -3.0])
    n = model.lattice.n_nodes
    turned = q.copy()
    turned[: 3 * n] = turn.apply(q[: 3 * n].reshape(-1, 3)).ravel()
    rates = np.cross(spin, turned[: 3 * n].reshape(-1, 3)).ravel()
    u[: 3 * n] = rates
    turns = np.empty((2, len(system.columns), 3, 3))
    bordered_kernel.fill_both_rotations(
        bordered_kernel.factor_tables(system, factors), n, 1e-4, turned, u, turns
    )
    assert np.abs(turns[0] - turn.as_matrix()).max() < 1e-12
    later = (Rotation.from_rotvec(1e-4 * spin) * turn).as_matrix()
    assert np.abs(turns[1] - later).max() < 1e-6


@pytest.mark.parametrize("links", [1, 2])
def test_the_residual_is_the_models_force_less_its_momentum(links):
    simulation = sheet(DRAG, FLOOR, arms={**ARMS, "links": links})
    simulation.inputs.set_torque([0.02, -0.01])
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    a = random.normal(size=len(model.free))
    kernel = dirk_kernel.DirkKernel(model, LinearSystem(model), np.ones(len(model.free)))
    residual, force = np.empty(len(a)), np.empty(len(q))
    drive, steady = kernel.force.drive(0.0, held), kernel.force.steady(held)
    table = kernel.sheet
    bordered_kernel.fill_residual(
        table.force,
        drive,
        steady,
        table.scratch,
        table.free,
        table.mass,
        q,
        u,
        a,
        table.inertia,
        force,
        residual,
    )
    expected = model.force(0.0, q, u, held) - dense_mass(model, q) @ a
    assert np.abs(residual - expected).max() <= 1e-10 * np.abs(expected).max()
    bordered_kernel.times_mass(table.inertia, table.mass, a, table.mass.size)
    assert np.abs(a - dense_mass(model, q) @ np.linalg.solve(dense_mass(model, q), a)).max() < 1e-9
    assert np.abs(model.force(0.0, q, u, held) - a - residual).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("make", [lambda: sheet(DRAG, FLOOR, accuracy=1e-5), lambda: loose(accuracy=1e-5)])
def test_stages_at_once_are_the_effects_called_one_by_one(make):
    runs = [make(), make()]
    runs[1].integrator.call_effects_one_by_one()
    for run in runs:
        if run.inputs.torque is not None:
            run.inputs.set_torque([0.05, -0.02])
        else:
            q, u, _ = moved(run)
            nodes = slice(0, 3 * run.lattice.n_nodes)
            run.start_from(q[nodes].reshape(-1, 3), 3.0 * u[nodes].reshape(-1, 3))
        run.advance_to(0.012)
    assert runs[0].integrator.kernel is not None
    assert np.abs(runs[0].state.position - runs[1].state.position).max() < 1e-9
    for name in ("steps", "rejected_steps", "evaluations", "factorisations", "solves"):
        assert getattr(runs[0].statistics, name) == getattr(runs[1].statistics, name), name
    estimates = [run.statistics.error_estimate for run in runs]
    assert estimates[0] == pytest.approx(estimates[1], rel=1e-3)
    motion, held = runs[0].last_step.right, runs[0].inputs.held()
    rate = runs[0].integrator.damping_rate(motion, held)
    assert rate == pytest.approx(runs[0].model.damping_rate(motion, held), rel=1e-6)


def two_steps(simulation, h, torque=None):
    """Return the last step of the formula after two of the one-step method and one of its own, and that before it."""
    integrator, held = simulation.integrator, simulation.inputs.held()
    motion = integrator.start(0.0, *simulation.model.reference_state(), held)
    first = integrator.one_step(motion, held, h, 1e-10)
    second = integrator.formula(first.right, held, 1.5 * h, 1e-10)
    if torque is not None:
        simulation.inputs.set_torque(torque)
        held = simulation.inputs.held()
    return second, integrator.formula(second.right, held, 0.75 * h, 1e-10), held


def test_a_step_of_the_two_step_formula_satisfies_it():
    simulation = sheet(DRAG, integrator="bdf2", dt=1e-3)
    simulation.inputs.set_torque([0.05, -0.02])
    past, step, held = two_steps(simulation, 4e-4)
    model, free, w, h = simulation.model, simulation.model.free, 0.5, 3e-4
    b, c = (1.0 + w) / (1.0 + 2.0 * w) * h, w * w / (1.0 + 2.0 * w)
    before, now, after = past.left, past.right, step.right
    a = model.accelerate(after.time, after.q, after.u, held)
    u = now.u[free] + c * (now.u - before.u)[free] + b * a
    q = now.q[free] + c * (now.q - before.q)[free] + b * after.u[free]
    assert np.abs(after.u[free] - u).max() < 1e-4 * np.abs(after.u).max()
    assert np.abs(after.q[free] - q).max() < 1e-12
    assert np.abs(after.a - a).max() < 1e-4 * np.abs(a).max()
    # Its own error: 2/9 h^2 of what the acceleration changed, or of what no straight line foresaw.
    changed = after.a - now.a
    unforeseen = changed - w * (now.a - past.left.a)
    reach = np.ones(len(free))
    reach[model.n_free_nodes :] = model.lattice.size[0]
    bound = 2.0 / 9.0 * h * h * (reach * np.maximum(np.abs(changed), 0.25 * np.abs(unforeseen))).max()
    # W^-1 M takes away what stiff parts have forgotten.
    matrix = dense_stage(model, after.q, after.u, held, b)
    filtered = np.linalg.solve(
        matrix, dense_mass(model, after.q) @ (2.0 / 9.0 * h * h * (changed + b / h * unforeseen))
    )
    assert step.error == pytest.approx(min(bound, np.abs(reach * filtered).max()), rel=0.1)


def test_a_jump_of_commands_is_answered_as_the_formula_says():
    simulation = sheet(integrator="bdf2", dt=1e-3)
    h, w, before = 3e-4, 0.5, simulation.inputs.held()
    past, step, held = two_steps(simulation, 4e-4, torque=[0.01, -0.02])
    model, free, start, end = simulation.model, simulation.model.free, step.left, step.right
    jump = model.force_jump(start.time, start.q, start.u, before, held)[free]
    matrix = dense_stage(model, end.q, end.u, held, (1.0 + w) / (1.0 + 2.0 * w) * h)
    moved_by, impulse, *_ = answer_to_a_jump(h, w, matrix, dense_mass(model, end.q), jump)
    b, c = (1.0 + w) / (1.0 + 2.0 * w) * h, w * w / (1.0 + 2.0 * w)
    a = model.accelerate(end.time, end.q, end.u, held)
    u = (end.u - start.u - c * (start.u - past.left.u))[free] - b * a
    q = (end.q - start.q - c * (start.q - past.left.q) - b * end.u)[free]
    assert np.abs(u - impulse).max() < 0.03 * np.abs(impulse).max()
    assert np.abs(q - moved_by).max() < 0.03 * np.abs(moved_by).max()
    assert np.abs(impulse).max() > 1e-2


def test_a_step_of_the_formula_counts_its_evaluations_or_fails(monkeypatch):
    calls, fill = [], stage_kernel.fill_residual
    monkeypatch.setattr(stage_kernel, "fill_residual", lambda *tables: calls.append(fill(*tables)))
    simulation = sheet(integrator="bdf2", dt=1e-3)
    simulation.inputs.set_torque([0.05, -0.02])
    _, step, held = two_steps(simulation, 4e-4)
    integrator = simulation.integrator
    counted = integrator.counters.evaluations
    calls.clear()
    integrator.formula(step.right, held, 3e-4, 1e-10)
    assert integrator.counters.evaluations - counted == len(calls) >= 2
    integrator.patience = 1
    with pytest.raises(base.StepFailure, match="does not converge"):
        integrator.formula(step.right, held, 3e-4, 1e-14)


def test_a_jump_of_commands_is_answered_to_third_order_in_its_step():
    exact = {}
    errors = []
    for h in (4e-4, 2e-4):
        simulation = sheet(integrator="bdf2", dt=1e-3)
        _, step, held = two_steps(simulation, h, torque=[2e-4, -1e-4])
        start, length = step.left, step.right.time - step.left.time
        integrator = sheet(integrator="esdirk43", dt=1e-4).integrator
        motion = integrator.start(start.time, start.q, start.u, held)
        for _ in range(4):
            motion = integrator.step(motion, held, length / 4, 1e-12).right
        nodes = slice(0, 3 * simulation.model.lattice.n_nodes)
        exact[h] = np.abs(motion.q - start.q)[nodes].max()
        errors.append(np.abs(step.right.q - motion.q)[nodes].max())
        assert errors[-1] < 0.3 * exact[h]
    assert errors[1] < 0.3 * errors[0]


def answer_to_a_jump(h, w, matrix, mass, jump, kept=None):
    """Return what a jump of the force adds to q [m] and u [m/s] beside b h A, and what it adds to A at both ends.

    kept is the b of the matrix [s], that of the step by default.
    """
    b = (1.0 + w) / (1.0 + 2.0 * w) * h
    kept = b if kept is None else kept
    lasting = np.linalg.solve(matrix, jump) if jump.size else np.zeros(len(matrix))
    squared = np.linalg.solve(matrix, mass @ lasting)
    # alpha + beta = w / (1 + 2 w) and alpha + 2 beta = -1 / (2 b / h (1 + 2 w)), with the matrix's b.
    beta = -0.5 * h * h / (kept * (1.0 + 2.0 * w)) - h * w / (1.0 + 2.0 * w)
    impulse = (h * w / (1.0 + 2.0 * w) - beta) * lasting + beta * squared
    left = (2.0 - h / kept) * lasting + (h / kept - 1.0) * squared
    return b * (impulse + beta * lasting), impulse, lasting, left


def off_the_formula(model, held, kept, numbers, jump, before, errors, motion, vectors):
    """Return how far a step is off the formula: q [m], u [m/s] and the carried error (fractions of it)."""
    free = model.free
    h, w = numbers[command_kernel.LENGTH], numbers[command_kernel.LENGTH] / numbers[command_kernel.BEFORE]
    b, c = (1.0 + w) / (1.0 + 2.0 * w) * h, w * w / (1.0 + 2.0 * w)
    time = numbers[command_kernel.BEGIN] + numbers[command_kernel.END] * h
    a = model.accelerate(time, motion[0], motion[1], held)
    matrix, mass = dense_stage(model, motion[0], motion[1], held, b), dense_mass(model, motion[0])
    answering = dense_stage(model, before[0], before[1], held, kept)
    moved_by, impulse, lasting, left = answer_to_a_jump(h, w, answering, mass, jump, kept)
    off_q = (motion[0] - before[0] - c * (before[0] - before[2]) - b * motion[1])[free] - moved_by
    off_u = (motion[1] - before[1] - c * (before[1] - before[3]))[free] - impulse - b * a
    # e_u = k_u + b A_e with W A_e = f(q + k_q + b k_u, u + k_u) - M A, the formula's own error in k.
    constant = (1.0 + w) ** 2 / (6.0 * w * (1.0 + 2.0 * w)) * h * h
    made = -constant * (vectors[1] - errors[1] - left)
    k_q = errors[2] + c * (errors[2] - errors[4]) + made
    k_u = errors[3] + c * (errors[3] - errors[5])
    assert np.array_equal(motion[2:], before[:2]) and np.array_equal(vectors[4:], errors[2:4])
    off_past = np.abs(vectors[0] - errors[1] - lasting).max() / max(np.abs(lasting).max(), 1.0)
    moved, rate = motion[0].copy(), motion[1].copy()
    rate[free] += k_u + made / b
    moved[free] += k_q + b * k_u - constant * h / b * vectors[1]
    force = model.force(time, moved, rate, held) - model.momentum(motion[0], vectors[1])
    # The second derivative of the drive, by a difference over 0.1 ms.
    drives = [model.force(time + shift, motion[0], motion[1], held) for shift in (-1e-4, 0.0, 1e-4)]
    force -= constant * h / b * (drives[0] - 2.0 * drives[1] + drives[2]) / 1e-8
    pull = b * np.linalg.solve(matrix, force)
    off_error = np.abs(vectors[3] - k_u - pull).max() * b / np.abs(vectors[2]).max()
    off_place = np.abs(vectors[2] - k_q - b * vectors[3]).max() / np.abs(vectors[2]).max()
    return np.abs(off_q).max(), np.abs(off_u).max(), off_error, off_place, off_past, np.abs(impulse).max()


REGULAR = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)
IRREGULAR = (0.0, 2.0, 4.0, 6.0, 7.1, 9.9, 11.0, 14.0, 15.0, 15.4, 18.0)


@pytest.mark.parametrize("times", [REGULAR, IRREGULAR], ids=["regular", "irregular"])
@pytest.mark.parametrize("drive", ["torque", "pressure"])
def test_rows_of_steps_satisfy_the_formula_and_carry_its_error(monkeypatch, drive, times):
    found, advance, loads, seen = [], command_kernel.advance, CommandFormula.loads, []

    def watched(*arguments):
        *tables, numbers, motion, vectors, jump, rotations, results = arguments
        single, part = numbers.copy(), results.copy()
        q, v, turns = motion.copy(), vectors.copy(), rotations.copy()
        # A step that is taken again has the commands of before the one that cut it short.
        held, kept = next(load.held for load in seen if load.drive is tables[1]), tables[5].rate_step
        # The same row step by step.
        for k in range(int(numbers[command_kernel.FIRST]), int(numbers[command_kernel.END])):
            single[command_kernel.FIRST], single[command_kernel.END] = k, k + 1
            before, errors = q.copy(), v.copy()
            advance(*tables, single, q, v, jump, turns, part)
            assert part[command_kernel.DONE] == 1.0
            off = off_the_formula(simulation.model, held, kept, single, jump, before, errors, q, v)
            found.append((jump.size, abs(single[command_kernel.LENGTH] - 1.5 * kept) > 1e-9, *off))
            jump = np.zeros(0)
            single[command_kernel.BEFORE] = single[command_kernel.LENGTH]
            single[command_kernel.TURNED] = part[command_kernel.MOVED]
            single[command_kernel.FIRST_RATE] = part[command_kernel.FIRST_SEEN]
            single[command_kernel.LATER_RATE] = part[command_kernel.LATER_SEEN]
        advance(*arguments)
        assert results[command_kernel.ITERATIONS] <= 5 * results[command_kernel.DONE]
        np.testing.assert_allclose(motion, q, atol=1e-12)
        np.testing.assert_allclose(vectors[2:], v[2:], rtol=1e-6, atol=1e-15)
        distances = np.linalg.norm(vectors[2, : simulation.model.n_free_nodes].reshape(-1, 3), axis=1)
        assert results[command_kernel.CARRIED] >= distances.max()

    def watched_loads(formula, held):
        seen.append(loads(formula, held))
        return seen[-1]

    monkeypatch.setattr(command_kernel, "advance", watched)
    monkeypatch.setattr(CommandFormula, "loads", watched_loads)
    simulation = sheet(nodes=(3, 3), arms={**ARMS, "drive": drive}, accuracy=1e-5)
    for k, time in enumerate(times):
        simulation.advance_to(1e-3 * time)
        values = 0.02 * np.sin(0.7 * k), 0.01 * np.cos(0.7 * k)
        if drive == "torque":
            simulation.inputs.set_torque(values)
        else:
            simulation.inputs.set_pressure([2e3 + 5e4 * value for value in values])
    simulation.advance_to(1e-3 * times[-1] + 2e-3)
    assert simulation.follows_commands
    # The first jump meets factors of the one-step method: its response is off by a few percent, and no later one's.
    off = np.array(found[1:])
    assert len(off) >= 6 and (off[:, 0] == 0).any() and off[:, 1].any() == (times is IRREGULAR)
    own, other = off[off[:, 1] == 0, 2:7], off[off[:, 1] == 1, 2:7]
    assert (own.max(axis=0) < [1e-8, 1e-3, 1e-2, 1e-3, 1e-3]).all()
    # A single solve with factors of another length carries the error to a tenth; the iteration needs no more than them.
    assert (other.max(axis=0, initial=0.0) < [1e-8, 2e-2, 1e-1, 1e-3, 1e-3]).all()
    # Torques jump, chambers do not.
    assert (off[:, 7].max() > 0.02) == (drive == "torque")


@pytest.mark.parametrize("links", [1, 2])
def test_a_step_on_a_manifold_leaves_no_projected_residual(links):
    simulation = sheet(DRAG, nodes=(3, 3), arms={**ARMS, "links": links})
    simulation.inputs.set_torque([0.05, 0.02])
    model, held, h = simulation.model, simulation.inputs.held(), 2e-3
    mean, still = model.reference_state()
    random, free, n = np.random.default_rng(13), model.free, len(mean)
    scale, decoder = np.array([1.0, 0.5]), np.zeros((5, n))
    decoder[:, free] = random.normal(size=(5, len(free))) * [[1.0], [1.0], [0.3], [0.3], [0.3]]
    lead = 11.0 / 6.0
    stiffness = dense_stage(model, mean, still, held, h / lead) * (lead / h) ** 2
    projection = np.zeros((2, n))
    projection[:, free] = np.linalg.pinv(decoder[:2, free].T) @ np.linalg.inv(stiffness)
    weights = np.zeros(n)
    weights[free[: model.n_free_nodes]] = model.mass

    def place(z):
        return mean + np.array([*z, z[0] * z[0], z[0] * z[1], z[1] * z[1]]) @ decoder

    zs = 1e-3 * np.array([[1.0, 2.0], [0.5, 1.5], [0.2, 1.0]])
    qs = np.stack([place(z) for z in zs])
    us = np.stack([(qs[0] - qs[1]) / h, (qs[1] - qs[2]) / h, (qs[1] - qs[2]) / h])
    old, guess, force = (
        (zs.copy(), qs.copy(), us.copy()),
        3.0 * zs[0] - 3.0 * zs[1] + zs[2],
        TotalForce(model),
    )
    iterations, unforeseen = manifold_step(
        force.tables, force.drive(0.0, held), force.steady(held), force.scratch, weights, mean, decoder, projection,
        scale, zs, qs, us, h, 1e-9, 20,
    )  # fmt: skip
    assert 0 < iterations <= 8
    assert np.array_equal(zs[1:], old[0][:2]) and np.array_equal(qs[1:], old[1][:2])
    np.testing.assert_allclose(qs[0], place(zs[0]), atol=1e-15)
    u = (11.0 * qs[0] - 18.0 * old[1][0] + 9.0 * old[1][1] - 2.0 * old[1][2]) / (6.0 * h)
    a = (11.0 * u - 18.0 * old[2][0] + 9.0 * old[2][1] - 2.0 * old[2][2]) / (6.0 * h)
    np.testing.assert_allclose(us, [u, *old[2][:2]], atol=1e-12)
    residual = model.force(0.0, qs[0], u, held) - dense_mass(model, qs[0]) @ a[free]
    assert np.abs(projection[:, free] @ residual * scale).max() < 1e-8
    assert unforeseen == pytest.approx(np.linalg.norm(scale * (zs[0] - guess)))
    assert unforeseen > 1e-5
    refused = manifold_step(
        force.tables, force.drive(0.0, held), force.steady(held), force.scratch, weights, mean, decoder, projection,
        scale, zs, qs, us, h, 1e-9, 1,
    )  # fmt: skip
    assert refused == (-2, np.inf)


def test_a_projection_is_the_mean_and_its_components_by_features_and_distances():
    random, r, leading, k, n, places = np.random.default_rng(5), 4, 3, 6, 11, 9
    z, metric = random.normal(size=r), random.uniform(0.5, 2.0, r)
    first, second = np.triu_indices(leading)
    features = np.concatenate([[1.0], z[:leading], z[first] * z[second]])
    fractions, differences = random.normal(size=(len(features), k)), random.normal(size=(places, k))
    at = random.normal(size=(places, r))
    components = random.normal(size=(k + 1, n)).astype(np.float32)
    found = np.empty(n, dtype=np.float32)
    fill_projection(z, leading, fractions, metric, at, differences, components, found)
    far = np.array([np.linalg.norm(place - z * metric) for place in at])
    expected = (features @ fractions - far @ differences) @ components[:k] + components[k]
    # Single precision, of sums whose terms reach some tens.
    np.testing.assert_allclose(found, expected, atol=2e-4)


@pytest.mark.parametrize("effects", [(), (DRAG, FLOOR)], ids=["arms", "arms, drag, floor"])
def test_compiled_stage_equations_are_those_of_the_matrices(effects):
    simulation = sheet(*effects)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    n, h = len(model.free), 2e-3
    a, vectors = random.normal(size=n), random.normal(size=(3, 2, n))
    exact = Linearisation(model, np.ones(n))
    kernel = LinearKernel(simulation.integrator.kernel, exact)
    matrices = exact.at(0.0, q, u, a, held)
    position, rate, mass = (matrix.to_scipy().toarray() for matrix in matrices)
    stage = mass - h * rate - h * h * position
    kernel.linearise(0.0, q, u, a, held)
    found = np.zeros((2, n))
    kernel.balance(*vectors, found)
    expected = (position @ vectors[0].T + rate @ vectors[1].T - mass @ vectors[2].T).T
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
    for product, matrix in zip(kernel.transposed(vectors[0, 0]), (position, rate), strict=True):
        expected = matrix.T @ vectors[0, 0]
        np.testing.assert_allclose(product, expected, atol=1e-11 * np.abs(expected).max())
    system = simulation.integrator.kernel.system
    factors = system.factor(0.0, q, u, held, h, corotated=True)
    factors = system.turn(factors, 0.0, q, u, held, h)
    for transposed, matrix in ((False, stage), (True, stage.T)):
        solution = np.zeros((2, n))
        contraction = kernel.solve(factors, h, vectors[0].copy(), solution, 1e-8, 1.0, transposed=transposed)
        expected = np.linalg.solve(matrix, vectors[0].T).T
        assert 0.0 < contraction <= 1.0
        np.testing.assert_allclose(solution, expected, atol=1e-6 * np.abs(expected).max())

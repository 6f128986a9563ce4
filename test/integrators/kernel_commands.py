"""The two-step formula for commands at a rate, executed by Python on small sheets, against dense matrices.

`test_kernels.py` runs this file as it does `kernel_steps.py`.
"""

from __future__ import annotations

import numpy as np
import pytest
from dense_sheet import ARMS, DRAG, dense_mass, dense_stage, sheet

from ldcs_ros.integrators import base
from ldcs_ros.integrators.implicit import (
    command_kernel,
    stage_kernel,
)
from ldcs_ros.integrators.implicit.command_formula import CommandFormula


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

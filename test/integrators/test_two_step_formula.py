"""The two-step formula answers jumps to its order, is started by the one-step method, and resumes to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.integrators.bdf2 import Bdf2
from ldcs_ros.integrators.implicit.block_tridiagonal import BlockTridiagonal
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.study.drive_profiles import drive_problem

pytestmark = pytest.mark.skipif(not HAVE_NUMBA, reason="the formula has a compiled form only")

# Commands that alternate around a mean: each is a jump, and what a jump costs adds up.
RATE, COMMANDS = 50.0, 8


def driven(name, **solver):
    content, course = drive_problem(name)
    return load_scene({**content, "solver": solver}).build(), course


def jumps(simulation, course, commands=range(COMMANDS)):
    for count in commands:
        simulation.advance_to(count / RATE)
        course.send(simulation.inputs, course.maximum * (0.25 if count % 2 else 0.1))
    simulation.advance_to(COMMANDS / RATE)
    return simulation


def test_block_factors_solve_what_the_band_solves():
    simulation, course = driven("paper", accuracy=1e-4)
    jumps(simulation, course)
    model, motion, held = simulation.model, simulation.last_step.right, simulation.inputs.held()
    where = motion.time, motion.q, motion.u, held, 2e-3
    right = np.random.default_rng(0).normal(size=len(model.free))
    band, blocks = (LinearSystem(model, storage).factor(*where) for storage in (None, BlockTridiagonal))
    expected = band.solve(right)
    assert np.abs(blocks.solve(right) - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["paper", "rig", "arc_pushed"])
def test_half_the_step_leaves_less_than_half_of_the_error_after_jumps(name):
    simulation, course = driven(name, accuracy=1e-8)
    known = jumps(simulation, course).state.position
    errors = []
    for dt in (2e-3, 1e-3):
        simulation, course = driven(name, integrator="bdf2", dt=dt)
        errors.append(np.abs(jumps(simulation, course).state.position - known).max())
    # Stiff couplings take a part of the second order after a jump.
    assert errors[1] < 5e-5 and errors[0] / errors[1] > 2.0, errors


def test_a_resumed_run_goes_on_to_the_bit():
    simulation, course = driven("rig", integrator="bdf2", dt=1e-3)
    jumps(simulation, course, range(4))
    simulation.advance_to(0.1605)  # inside a step
    kept = simulation.state
    ends = []
    for _ in range(2):
        simulation.reset(kept)
        course.send(simulation.inputs, 0.3 * course.maximum)
        simulation.advance_to(0.25)
        ends.append(simulation.state.position.copy())
    assert np.array_equal(*ends)


def test_a_wrench_that_turns_with_the_sheet_is_left_to_the_one_step_method():
    simulation, _ = driven("paper", integrator="bdf2", dt=2e-3)
    simulation.advance_to(0.02)
    simulation.inputs.set_wrench("P1", force=(0.0, 0.0, 0.1))
    motion, held = simulation.last_step.right, simulation.inputs.held()
    method = simulation.integrator
    assert isinstance(method, Bdf2)
    before = method.counters.evaluations
    step = method.step(motion, held, 2e-3, 1e-8)
    assert step.right.time == pytest.approx(0.022)
    assert method.counters.evaluations - before >= 5  # a stage of the one-step method takes at least one


def test_a_step_of_a_smooth_motion_takes_one_or_two_evaluations():
    simulation, course = driven("rig", integrator="bdf2", dt=1e-3)
    jumps(simulation, course)
    assert simulation.statistics.evaluations < 2.5 * simulation.statistics.steps

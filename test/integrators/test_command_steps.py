"""Commands at a rate: within the asked accuracy with an honest estimate, resumed to the bit, looked at as one likes."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.study.drive_profiles import drive_problem

pytestmark = pytest.mark.skipif(not HAVE_NUMBA, reason="the formula has a compiled form only")

END = 0.16


def built(name, accuracy, **solver):
    content, course = drive_problem(name)
    return load_scene({**content, "solver": {"accuracy": accuracy, **solver}}).build(), course


def times_of(kind, random):
    if kind == "irregular":
        times = np.cumsum(random.uniform(3e-4, 0.03, 200))
        return times[times < END]
    return np.arange(0.0, END, 1e-3 if kind == "1 kHz" else 1e-2)


def commanded(simulation, course, times, values, looks=()):
    """Send values (fractions of the largest) at times; return node positions at the looks and at the end [m]."""
    seen = []
    events = sorted(
        [*((time, k) for k, time in enumerate(times)), *((look, -1) for look in looks), (END, -1)]
    )
    for time, k in events:
        simulation.advance_to(float(time))
        if k < 0:
            seen.append(simulation.state.position.copy())
        else:
            course.send(simulation.inputs, float(values[k] * course.maximum))
    return np.array(seen)


@pytest.mark.parametrize("name", ["paper", "rig"])
@pytest.mark.parametrize("kind", ["100 Hz", "1 kHz", "irregular", "noisy"])
def test_commands_at_a_rate_keep_the_asked_accuracy_and_say_so(name, kind):
    random = np.random.default_rng(11)
    times = times_of(kind, random)
    values = 0.5 - 0.5 * np.cos(2.0 * np.pi * random.uniform(1.0, 3.0) * times)
    if kind == "noisy":
        values = np.clip(values + 0.01 * random.standard_normal(len(times)), 0.0, 1.0)
    looks, accuracy = np.linspace(0.01, END, 23), 1e-4
    finer, course = built(name, 1e-2 * accuracy, integrator="esdirk43")
    known = commanded(finer, course, times, values, looks)
    simulation, course = built(name, accuracy)
    made = commanded(simulation, course, times, values, looks)
    assert simulation.follows_commands
    error = np.linalg.norm(made - known, axis=-1).max()
    assert error <= accuracy
    # The reference is itself off by up to a hundredth of what was asked.
    assert simulation.statistics.error_estimate >= (error - 0.01 * accuracy) / 1.5


@pytest.mark.parametrize("kind", ["100 Hz", "irregular"])
def test_how_often_one_looks_does_not_change_commanded_motion(kind):
    times = times_of(kind, np.random.default_rng(2))
    values = np.linspace(0.0, 1.0, len(times))
    ends = []
    for looks in ((), np.linspace(0.0, END, 321), np.linspace(0.0, END, 47)):
        simulation, course = built("paper", 1e-4)
        ends.append(commanded(simulation, course, times, values, looks)[-1])
    assert np.array_equal(ends[0], ends[1]) and np.array_equal(ends[0], ends[2])


@pytest.mark.parametrize("at", [0.06, 0.0633])
def test_a_commanded_run_goes_on_from_a_state_to_the_bit(at):
    simulation, course = built("rig", 1e-4)

    def go_on():
        for k in range(7, 14):
            simulation.advance_to(0.01 * k)
            course.send(simulation.inputs, 0.05 * k * course.maximum)
        simulation.advance_to(END)
        return simulation.state

    for k in range(7):
        simulation.advance_to(0.01 * k)
        course.send(simulation.inputs, 0.05 * k * course.maximum)
    simulation.advance_to(at)
    kept = simulation.state
    assert simulation.follows_commands
    went = go_on()
    simulation.reset(kept)
    again = go_on()
    assert np.array_equal(went.position, again.position) and np.array_equal(went.velocity, again.velocity)


def test_the_one_step_method_serves_without_commands_at_a_rate_and_after_the_last_one():
    simulation, course = built("paper", 1e-4)
    times = times_of("100 Hz", None)[:8]
    for time in times:
        simulation.advance_to(time)
        course.send(simulation.inputs, 5.0 * time * course.maximum)
        # Two intervals make a rate; a step with the formula follows them.
        assert simulation.follows_commands == (time > 0.035)
    simulation.advance_to(0.4)
    assert not simulation.follows_commands


def test_a_named_method_takes_every_step_itself():
    simulation, course = built("paper", 1e-4, integrator="esdirk43")
    for time in times_of("100 Hz", None):
        simulation.advance_to(time)
        course.send(simulation.inputs, time * course.maximum)
    assert not simulation.follows_commands


def test_a_command_that_waits_in_a_valve_changes_no_step():
    ends = []
    for commands in (1, 3):
        simulation, course = built("rig", 1e-4)
        for k in range(commands):
            simulation.advance_to(0.005 * k)
            course.send(simulation.inputs, (0.5 + 0.1 * k) * course.maximum)
        simulation.advance_to(0.0199)
        ends.append(simulation.state.position.copy())
    assert np.array_equal(*ends)


@pytest.mark.parametrize("times", [(0.1, 0.101), (0.1, 0.100001, 0.100002)])
def test_a_few_commands_close_together_are_not_yet_a_rate(times):
    simulation, course = built("paper", 1e-4)
    for k, time in enumerate(times):
        simulation.advance_to(time)
        course.send(simulation.inputs, 0.3 * (k + 1) * course.maximum)
    simulation.advance_to(0.11)
    assert not simulation.follows_commands


def test_steps_shorten_soon_where_commands_let_the_error_grow():
    """Torques with noise on a light sheet: the first steps of the formula are too long for it."""
    noise = np.random.default_rng(100).normal(size=(30, 2))
    inputs = [
        {"time": k / 100, "torque": [float(0.05 + 0.04 * np.sin(0.06 * k) + 2e-4 * one) for one in pair]}
        for k, pair in enumerate(noise)
    ]
    content = {
        "lattice": {"size": [0.14, 0.14, 0.007], "nodes": [4, 3], "mass": 0.1},
        "effects": [
            {"type": "springs", "law": "axial", "stiffness": 300.0, "damping": 1.0},
            {"type": "gravity"},
            {"type": "clamp", "edge": "x_min"},
            {"type": "arms", "drive": "torque", "links": 3},
        ],
        "inputs": inputs,
    }
    fine, run = (
        load_scene({**content, "solver": {"commands": "held", "accuracy": a}}).build() for a in (1e-8, 1e-5)
    )
    gap, has_followed = 0.0, False
    for time in np.arange(1, 58) / 200:
        for one in (fine, run):
            one.advance_to(time)
        gap = max(gap, np.linalg.norm(fine.state.position - run.state.position, axis=1).max())
        has_followed |= run.follows_commands
    assert has_followed
    assert gap <= 1e-5, "1.18e-5 with steps that stay for 20 ms"

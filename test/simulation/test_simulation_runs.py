"""A simulation's promises: the same bits, the same answer however often one looks, resumable, whole after errors."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.errors import CommandError, DivergenceError, SceneError
from ldcs_ros.integrators.base import StepFailure


@pytest.mark.parametrize("name", ["arc", "paper", "rig", "free_flight"])
def test_two_runs_agree_to_the_bit(name):
    first, second = load_scene(name).build(), load_scene(name).build()
    for simulation in (first, second):
        simulation.advance_to(0.5)
    np.testing.assert_array_equal(first.state.position, second.state.position)
    np.testing.assert_array_equal(first.state.velocity, second.state.velocity)


def test_how_often_one_looks_does_not_change_the_answer():
    once, often = load_scene("paper").build(), load_scene("paper").build()
    once.advance_to(0.4)
    for k in range(1, 401):
        often.advance_to(k / 1000)
    np.testing.assert_array_equal(once.state.position, often.state.position)
    assert once.statistics.steps == often.statistics.steps


@pytest.mark.parametrize("waiting", [False, True])
def test_a_run_goes_on_from_a_state_to_the_bit(waiting):
    simulation = load_scene("rig").build()
    simulation.advance_to(0.3)
    if waiting:  # commanded, but nobody has advanced past it yet
        simulation.inputs.set_pressure((100e3, 120e3))
    state = simulation.state
    simulation.advance_to(0.6)
    went = simulation.state
    simulation.reset(state)
    assert simulation.time == 0.3
    simulation.advance_to(0.6)
    np.testing.assert_array_equal(simulation.state.position, went.position)
    np.testing.assert_array_equal(simulation.state.pressure, went.pressure)


def test_reset_goes_back_to_the_first_bit():
    simulation = load_scene("paper").build()
    simulation.advance_to(0.2)
    first = simulation.state
    simulation.inputs.set_torque(0.0)
    simulation.advance_to(0.4)
    simulation.reset()
    assert simulation.time == 0.0 and simulation.statistics.steps == 0
    simulation.advance_to(0.2)
    np.testing.assert_array_equal(simulation.state.position, first.position)


def test_a_command_acts_at_the_time_advanced_to():
    simulation = load_scene("rig").build()
    simulation.advance_to(1.0)
    before = simulation.state.pressure
    simulation.inputs.set_pressure(0.0)
    simulation.advance_to(1.0 + 0.02)  # the dead time of the scene's valves
    assert (simulation.state.pressure >= before).all()
    simulation.advance_to(1.0 + 0.02 + 0.10)  # one time constant of venting
    np.testing.assert_allclose(simulation.state.pressure, before * np.exp(-1.0), rtol=2e-3)


def test_events_a_rounding_apart_are_one():
    # Dead time 0.02 s: 0.34 + 0.02 is 0.36000000000000004, a hair after the look at 0.36.
    simulation = load_scene("rig").build()
    for k in range(5, 60):
        simulation.advance_to(k / 50)
        simulation.inputs.set_pressure(100e3 * (1 - k / 60))
    assert np.isfinite(simulation.state.position).all()


def test_a_command_that_repeats_the_last_costs_no_step():
    calm, repeating = load_scene("rig").build(), load_scene("rig").build()
    for k in range(1, 50):
        repeating.inputs.set_pressure(140e3)
        repeating.advance_to(k / 100)
    calm.advance_to(0.49)
    np.testing.assert_array_equal(calm.state.position, repeating.state.position)


def test_pressure_rises_and_falls_with_its_own_time_constants_and_stays_within_its_limits():
    simulation = load_scene("rig").build()
    course = []
    for k in range(1, 400):
        if k % 50 == 0:
            simulation.inputs.set_pressure(200e3 if k % 100 else 0.0)
        simulation.advance_to(k / 200)
        course.append(simulation.state.pressure)
    assert np.min(course) >= 0.0 and np.max(course) <= 200e3


def test_a_schedule_yields_to_whoever_commands():
    scene = load_scene("paper")
    simulation = scene.build()
    simulation.inputs.set_torque(0.05)
    simulation.advance_to(0.1)
    np.testing.assert_allclose(simulation.joint_torque, 0.05)


def test_commands_in_a_row_cost_no_accuracy():
    # 100 Hz commands that say the same but for rounding: what was integrated past each is dropped and taken again.
    calm, nervous = load_scene("paper").build(), load_scene("paper").build()
    for k in range(1, 41):
        nervous.inputs.set_torque(0.1392 + 1e-14 * (k % 2))
        nervous.advance_to(k / 100)
    calm.advance_to(0.4)
    assert np.abs(calm.state.position - nervous.state.position).max() < 2e-5  # each within the asked 1e-5


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (lambda inputs: inputs.set_pressure(-1.0), "expected 0"),
        (lambda inputs: inputs.set_pressure(201e3), "expected 0"),
        (lambda inputs: inputs.set_pressure([1.0, 2.0, 3.0]), "shape"),
        (lambda inputs: inputs.set_pressure([float("nan"), 0.0]), "finite"),
        (lambda inputs: inputs.set_pressure("high"), "numbers"),
        (lambda inputs: inputs.set_torque(0.1), "drive: torque"),
        (lambda inputs: inputs.set_wrench("P7", force=(0, 0, 1)), "unknown frame"),
        (lambda inputs: inputs.set_wrench("node_top_9_0", force=(0, 0, 1)), "no node"),
        (lambda inputs: inputs.set_wrench("P1", force=(0, 0, 1e6)), "at most"),
        (lambda inputs: inputs.set_wrench("P1", force=(0, float("inf"), 0)), "finite"),
    ],
)
def test_a_bad_command_is_refused_whole(command, words):
    simulation = load_scene("rig").build()
    simulation.advance_to(0.1)
    version = simulation.inputs.version
    with pytest.raises(CommandError, match=words):
        command(simulation.inputs)
    assert simulation.inputs.version == version
    np.testing.assert_array_equal(simulation.inputs.pressure, [140e3, 140e3])


def test_a_scene_without_arms_refuses_arm_commands_and_says_what_to_add():
    simulation = load_scene("arc").build()
    with pytest.raises(CommandError, match="type: arms, drive: pressure"):
        simulation.inputs.set_pressure(0.0)


@pytest.mark.parametrize("time", [float("nan"), float("inf"), -1.0, 0.05])
def test_time_goes_forward_only(time):
    simulation = load_scene("arc").build()
    simulation.advance_to(0.1)
    with pytest.raises(ValueError, match="advance"):
        simulation.advance_to(time)


def test_a_failing_step_leaves_the_state_whole_and_the_run_usable(monkeypatch):
    simulation = load_scene("arc").build()
    simulation.advance_to(0.1)
    before = simulation.state

    def fail(motion, inputs, h, tolerance):
        raise StepFailure("for the test")

    with monkeypatch.context() as patch:
        patch.setattr(simulation.integrator, "step", fail)
        with pytest.raises(DivergenceError, match=r"t = .* s: no step above"):
            simulation.advance_to(1.0)
    np.testing.assert_array_equal(simulation.state.position, simulation.state.position)
    assert np.isfinite(simulation.state.position).all() and simulation.time == before.time
    np.testing.assert_array_equal(simulation.state.position, before.position)
    simulation.advance_to(0.2)


def test_settling_needs_something_that_holds_the_sheet():
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [3, 3], "mass": 0.16},
        "effects": [{"type": "springs"}, {"type": "gravity"}],
    }
    simulation = load_scene(scene).build()
    before = simulation.state
    with pytest.raises(DivergenceError, match="rest state"):
        simulation.settle()
    np.testing.assert_array_equal(simulation.state.position, before.position)


def test_a_scene_in_which_nothing_can_move_is_refused():
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [2, 2], "mass": 0.16},
        "effects": [
            {"type": "springs"},
            {"type": "clamp", "edge": "x_min"},
            {"type": "clamp", "edge": "x_max"},
        ],
    }
    with pytest.raises(SceneError, match="nothing can move"):
        load_scene(scene).build()


def test_a_fixed_step_is_kept_but_for_stops():
    scene = load_scene("arc").text.replace(
        "{integrator: auto, accuracy: 1.0e-5}", "{integrator: trbdf2, dt: 0.001}"
    )
    from ldcs_ros.scene.load import parse_scene

    simulation = parse_scene(scene, name="fixed", origin="fixed").build()
    simulation.advance_to(2.0)
    assert simulation.statistics.steps == 2000


@pytest.mark.parametrize("integrator", ["esdirk43", "trbdf2"])
def test_energy_only_leaves_through_dashpots(integrator):
    # Released from a bent shape with nothing else acting, the total energy falls at every look.
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [5, 5], "mass": 0.16},
        "effects": [{"type": "springs"}, {"type": "clamp"}, {"type": "gravity"}],
        "solver": {"integrator": integrator, "accuracy": 1e-6},
    }
    simulation = load_scene(scene).build()
    totals = []
    for k in range(200):
        simulation.advance_to(k / 100)
        totals.append(sum(simulation.energy()))
    # Rises by less than the work of a weight of 1.6 N over the asked accuracy.
    assert np.diff(totals).max() < 1.6 * 1e-6
    assert totals[-1] < totals[0]


def test_nodes_in_holes_have_no_place():
    # P0 would be in the hole.
    content = small_sheet(points={"P1": ["mid", "free_edge"]}, sensors={})
    content["lattice"]["holes"] = [{"circle": [0.07, 0.0, 0.01]}]
    simulation = load_scene(content).build()
    missing = simulation.lattice.missing
    assert len(missing) == 2
    expected = np.zeros(simulation.lattice.n_nodes, dtype=bool)
    expected[missing] = True
    for values in (simulation.state.position, simulation.state.velocity):
        np.testing.assert_array_equal(np.isnan(values).any(axis=1), expected)


def test_a_valve_without_dead_time_has_its_target_at_once():
    simulation = load_scene(small_sheet()).build()
    simulation.inputs.set_pressure([10e3, 20e3])
    assert [chamber.target for chamber in simulation.inputs.held().chambers] == [10e3, 20e3]


@pytest.mark.parametrize(("quantity", "unit"), [("force", "N"), ("torque", "N m")])
def test_a_wrench_of_wrong_size_is_refused_with_its_unit(quantity, unit):
    simulation = load_scene(small_sheet({"type": "wrench"})).build()
    with pytest.raises(CommandError) as refused:
        simulation.inputs.set_wrench("P1", **{quantity: (0.1, 0.2)})
    assert str(refused.value).endswith(f"[{unit}]")


class EveryStep:
    def __init__(self):
        self.seen, self.taken = [], []

    def longest_step(self, step, held):
        self.seen.append(step)
        return step.right.time - step.left.time

    def take(self, step):
        assert step is self.seen[-1]
        self.taken.append((step.left.time, step.right.time))


def test_a_follower_sees_every_step_while_commands_come_at_a_rate():
    follower, simulation = EveryStep(), load_scene(small_sheet(nodes=(3, 3))).build()
    simulation.follow(follower)
    for k in range(10):
        simulation.advance_to(2e-3 * k)
        simulation.inputs.set_pressure(1e3 * k)
    simulation.advance_to(0.02)
    assert not simulation.follows_commands
    starts, ends = np.array(follower.taken).T
    assert starts[0] == 0.0 and ends[-1] >= 0.02
    # A command inside a step cuts it; none is left out.
    assert (starts[1:] <= ends[:-1]).all() and (np.diff(starts) > 0.0).all()

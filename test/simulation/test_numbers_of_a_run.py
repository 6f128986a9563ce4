"""Numbers of a run against formulas: oscillation and fall of a small sheet, its equilibrium, counts, names, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import CommandError, DivergenceError
from ldcs_ros.simulation.statistics import Statistics

# 2 x 2 cells' corners: 8 nodes of 10 g.
SHEET = {"size": [0.1, 0.1, 0.01], "nodes": [2, 2], "mass": 0.08}
POINTS = {"P1": ["mid", "free_edge"]}
SPRINGS = {"type": "springs", "law": "axial", "stiffness": 200.0, "damping": 2.0}
HANGING = {"lattice": SHEET, "points": POINTS, "effects": [SPRINGS, {"type": "gravity"}, {"type": "clamp"}]}


def scene(*effects, inputs=(), **keys):
    return load_scene(
        {"lattice": SHEET, "points": POINTS, "effects": list(effects), "inputs": list(inputs), **keys}
    )


def test_a_free_sheet_falls_by_half_g_t_squared_and_keeps_its_energy():
    simulation = scene({"type": "springs"}, {"type": "gravity", "acceleration": [0.0, 0.0, -10.0]}).build()
    before = simulation.energy()
    simulation.advance_to(0.3)
    fallen = simulation.state.position - simulation.lattice.reference_position
    np.testing.assert_allclose(fallen, np.tile([0.0, 0.0, -0.45], (8, 1)), atol=1e-9)
    np.testing.assert_allclose(simulation.state.velocity, np.tile([0.0, 0.0, -3.0], (8, 1)), atol=1e-9)
    kinetic, potential = simulation.energy()
    assert kinetic == pytest.approx(0.5 * 0.08 * 9.0)
    assert kinetic + potential == pytest.approx(sum(before), abs=1e-9)


def test_at_the_equilibrium_all_forces_vanish_and_a_swinging_sheet_ends_there():
    simulation = load_scene(HANGING).build()
    simulation.settle()
    model, motion = simulation.model, simulation.motion()
    force = model.force(motion.time, motion.q, motion.u, simulation.inputs.held())
    assert force.shape == model.free.shape and np.abs(force).max() < 1e-9
    assert not simulation.state.velocity.any()
    # The sheet swings around the same shape and comes to rest in it.
    swinging = load_scene(HANGING).build()
    swinging.advance_to(60.0)
    assert np.abs(swinging.state.position - simulation.state.position).max() < 1e-5


def test_settling_far_from_the_equilibrium_finds_the_same_one():
    simulation, crumpled = load_scene(HANGING).build(), load_scene(HANGING).build()
    rest = crumpled.lattice.reference_position
    crumpled.start_from(rest + np.random.default_rng(2).uniform(-0.02, 0.02, rest.shape))
    simulation.settle()
    crumpled.settle()
    # A step moves no node by more than half a spacing: the sheet keeps to its basin, hanging down.
    assert crumpled.state.position[:, 2].min() < -0.05
    np.testing.assert_allclose(crumpled.energy()[1], simulation.energy()[1], atol=1e-9)


def test_settling_fills_the_chambers_and_ends_the_schedule():
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "pressure", "fill_time": 0.5}
    inputs = [{"time": 0.1, "pressure": 20e3}, {"time": 0.7, "pressure": [30e3, 10e3]}]
    simulation = scene(SPRINGS, {"type": "clamp"}, arms, inputs=inputs).build()
    simulation.settle()
    assert simulation.time == 0.7
    np.testing.assert_allclose(simulation.state.pressure, [30e3, 10e3])
    # At rest each joint bends by gain times pressure over its stiffness, but for what the sheet resists.
    assert (simulation.state.joint_angle[0] > simulation.state.joint_angle[1]).all()
    np.testing.assert_allclose(simulation.joint_torque[0], 3.0 * simulation.joint_torque[1])


def test_a_failed_settling_changes_nothing():
    simulation = scene({"type": "springs"}, {"type": "gravity"}).build()
    simulation.advance_to(0.1)
    before = simulation.state
    with pytest.raises(DivergenceError, match="rest state"):
        simulation.settle()
    np.testing.assert_array_equal(simulation.state.position, before.position)
    assert simulation.time == 0.1


def test_the_counts_of_a_run_are_those_of_its_steps():
    simulation = load_scene(HANGING).build()
    simulation.advance_to(0.2)
    counts = simulation.statistics
    assert (
        counts.steps >= 2
        and counts.evaluations > 2 * counts.steps
        and counts.solves >= counts.evaluations // 2
    )
    assert counts.factorisations >= 1 and counts.wall_time > 0.0
    assert 0.0 < counts.error_estimate < 1e-5
    assert counts.velocity_estimate > 0.0
    steps, wall = counts.steps, counts.wall_time
    simulation.advance_to(0.4)
    assert simulation.statistics.steps > steps and simulation.statistics.wall_time > wall
    assert set(counts.as_dict()) == {
        "steps", "rejected_steps", "evaluations", "factorisations", "solves", "error_estimate", "velocity_estimate",
        "wall_time",
    }  # fmt: skip


def test_joints_are_numbered_from_one_base_to_tip():
    arms = {"type": "arms", "links": 3, "width": 0, "drive": "torque"}
    simulation = scene(
        SPRINGS, {"type": "clamp"}, arms, inputs=[{"time": 0.0, "torque": [0.01, 0.02]}]
    ).build()
    assert simulation.arm_names == ("left", "right")
    assert simulation.joint_names == tuple(f"{arm}_joint_{k}" for arm in ("left", "right") for k in (1, 2, 3))
    assert simulation.joint_index.tolist() == [0, 1, 2, 3, 4, 5]
    np.testing.assert_allclose(simulation.joint_torque, [[0.01] * 3, [0.02] * 3])
    bare = load_scene(HANGING).build()
    assert bare.joint_names == () and bare.joint_torque.shape == (0, 0) and bare.joint_index.size == 0
    assert bare.state.link_angle.shape == (0, 0) and bare.state.pressure.shape == (0,)
    with pytest.raises(ValueError, match=r"link_rate: .*\(2, 3\)"):
        simulation.start_from(simulation.lattice.reference_position, link_rate=np.zeros((2, 9)))
    rates = np.arange(6.0).reshape(2, 3)
    simulation.start_from(simulation.lattice.reference_position, link_rate=rates)
    np.testing.assert_array_equal(simulation.state.link_rate, rates)


def test_a_valve_answers_after_its_dead_time_and_fills_by_its_own_exponential():
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "pressure",
            "fill_time": 0.2, "vent_time": 0.1, "dead_time": 0.05}  # fmt: skip
    simulation = scene(SPRINGS, {"type": "clamp"}, arms).build()
    simulation.inputs.set_pressure([80e3, 40e3])
    assert simulation.inputs.next_valve_change() == pytest.approx(0.05)
    simulation.advance_to(0.05)
    np.testing.assert_allclose(simulation.state.pressure, [0.0, 0.0], atol=1e-6)
    simulation.advance_to(0.25)
    filled = np.array([80e3, 40e3]) * (1.0 - math.exp(-1.0))
    np.testing.assert_allclose(simulation.state.pressure, filled, rtol=1e-9)
    simulation.inputs.vent()
    simulation.advance_to(0.30)
    later = np.array([80e3, 40e3]) * (1.0 - math.exp(-0.25 / 0.2))
    np.testing.assert_allclose(simulation.state.pressure, later, rtol=1e-9)
    simulation.advance_to(0.50)
    np.testing.assert_allclose(simulation.state.pressure, later * math.exp(-2.0), rtol=1e-9)
    assert math.isinf(simulation.inputs.next_valve_change())


def test_two_valve_commands_within_a_dead_time_both_act_in_their_order():
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "pressure", "fill_time": 0.0, "vent_time": 0.0,
            "dead_time": 0.1}  # fmt: skip
    simulation = scene(SPRINGS, {"type": "clamp"}, arms).build()
    simulation.inputs.set_pressure(10e3)
    simulation.advance_to(0.04)
    simulation.inputs.set_pressure(20e3)
    for time, pressure in ((0.09, 0.0), (0.12, 10e3), (0.15, 20e3)):
        simulation.advance_to(time)
        np.testing.assert_allclose(simulation.state.pressure, [pressure] * 2)


def test_a_command_outlives_the_schedule_of_its_own_quantity_alone():
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "torque"}
    wrench = {"frame": "P1", "force": [0.0, 0.0, 0.1]}
    inputs = [{"time": 0.02, "torque": 0.03, "wrench": wrench}]
    simulation = scene(SPRINGS, {"type": "clamp"}, arms, {"type": "wrench"}, inputs=inputs).build()
    simulation.inputs.set_torque(0.01)
    simulation.advance_to(0.05)
    np.testing.assert_allclose(simulation.inputs.torque, 0.01)
    assert simulation.inputs.wrenches["P1"].force == (0.0, 0.0, 0.1)
    version = simulation.inputs.version
    simulation.inputs.set_wrench("P1", force=(0.0, 0.0, 0.1))
    simulation.inputs.set_torque([0.01, 0.01])
    assert simulation.inputs.version == version  # both repeat the present values
    simulation.inputs.clear_wrench("P1")
    assert simulation.inputs.wrenches == {} and simulation.inputs.version == version + 1
    other = scene(SPRINGS, {"type": "clamp"}, arms, {"type": "wrench"}, inputs=inputs).build()
    other.inputs.clear_wrench("P1")
    other.advance_to(0.05)
    assert other.inputs.wrenches == {}
    np.testing.assert_allclose(other.inputs.torque, 0.03)


@pytest.mark.parametrize(
    ("drive", "good", "bad"),
    [
        ("pressure", [190e3, 0.0], [[200e3, 200.1e3], [-1.0, 0.0], -0.001, [1.0]]),
        ("torque", [[2.0, -2.0], [0.0, 1.0]], [[[0.0, 0.0], [0.0, -2.001]], 2.001, [1.0, 2.0, 0.0]]),
    ],
)
def test_the_default_limits_of_the_arms_are_200_kpa_and_2_n_m(drive, good, bad):
    simulation = scene(
        SPRINGS, {"type": "clamp"}, {"type": "arms", "links": 2, "width": 0, "drive": drive}
    ).build()
    command = getattr(simulation.inputs, f"set_{drive}")
    command(good)
    kept = np.array(getattr(simulation.inputs, drive))
    for value in bad:
        if value == [1.0]:
            command(value)  # one number in a list is one for all
            command(good)
            continue
        with pytest.raises(CommandError):
            command(value)
    np.testing.assert_array_equal(getattr(simulation.inputs, drive), kept)


def test_a_scheduled_command_acts_at_its_time_and_not_before():
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "torque"}
    inputs = [{"time": 0.05, "torque": 0.03}]
    simulation = scene(SPRINGS, {"type": "clamp"}, arms, inputs=inputs).build()
    simulation.advance_to(0.04)
    assert not simulation.joint_torque.any()
    simulation.advance_to(0.06)
    np.testing.assert_allclose(simulation.joint_torque, 0.03)


def test_a_state_is_built_once_for_a_time_and_a_command():
    simulation = load_scene(HANGING).build()
    first = simulation.state
    assert simulation.state is first
    simulation.advance_to(0.01)
    assert simulation.state is not first and simulation.state is simulation.state
    simulation.reset(first)
    assert simulation.state.time == 0.0
    fresh = Statistics()
    assert not any(fresh.as_dict().values())


def test_valves_of_different_dead_times_each_answer_their_own_commands_in_order():
    two = [
        {"name": "fast", "from": [0.0, 0.05], "to": [0.1, 0.05], "dead_time": 0.02},
        {"name": "slow", "from": [0.0, -0.05], "to": [0.1, -0.05], "dead_time": 0.05},
    ]
    arms = {
        "type": "arms",
        "links": 1,
        "width": 0,
        "drive": "pressure",
        "fill_time": 0.0,
        "vent_time": 0.0,
        "arms": two,
    }
    simulation = scene(SPRINGS, {"type": "clamp"}, arms).build()
    simulation.inputs.set_pressure(10e3)
    simulation.advance_to(0.01)
    simulation.inputs.set_pressure(20e3)
    for time, pressures in (
        (0.025, [10e3, 0.0]),
        (0.04, [20e3, 0.0]),
        (0.055, [20e3, 10e3]),
        (0.07, [20e3, 20e3]),
    ):
        simulation.advance_to(time)
        np.testing.assert_allclose(simulation.state.pressure, pressures)


@pytest.mark.parametrize("drive", ["torque", "pressure"])
def test_a_vent_takes_every_command_of_the_arms_to_zero(drive):
    arms = {"type": "arms", "links": 2, "width": 0, "drive": drive}
    simulation = scene(SPRINGS, {"type": "clamp"}, arms).build()
    getattr(simulation.inputs, f"set_{drive}")(0.5)
    simulation.inputs.vent()
    assert not getattr(simulation.inputs, drive).any()

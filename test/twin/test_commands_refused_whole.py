"""A command is applied or refused whole; a refusal changes nothing and is counted by its reason."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fake_scene import RailScene

from ldcs_ros.messages.cdr import decode, encode, header, message_class
from ldcs_ros.messages.messages import pressure_command, torque_command, wrench_command


def torque(names, values):
    return torque_command(0, names, np.array(values))


def wrench(frame, force=(0.0, 0.0, 1.0), moment=(0.0, 0.0, 0.0)):
    return wrench_command(0, frame, force, moment)


REFUSED = [
    ("pressure", "pressure_command", pressure_command([]), "wrong size"),
    ("pressure", "pressure_command", pressure_command([1.0, 2.0, 3.0]), "wrong size"),
    ("pressure", "pressure_command", pressure_command([1.0, math.nan]), "not a number"),
    ("pressure", "pressure_command", pressure_command([math.inf]), "infinite"),
    ("pressure", "pressure_command", pressure_command([1.0, 9e9]), "over limit"),
    ("pressure", "pressure_command", b"\x00\x01\x00\x00\xff\xff\xff\xff", "malformed"),
    ("pressure", "pressure_command", b"", "malformed"),
    ("torque", "pressure_command", pressure_command([1.0]), "effect absent"),
    ("pressure", "torque_command", torque(["left_joint_1"], [0.1]), "effect absent"),
    ("torque", "torque_command", torque(["left_joint_1"], [0.1, 0.2]), "wrong size"),
    ("torque", "torque_command", torque([], []), "wrong size"),
    ("torque", "torque_command", torque(["left_joint_1", "left_joint_1"], [0.1, 0.2]), "wrong size"),
    ("torque", "torque_command", torque(["left_joint_1", "knee"], [0.1, 0.2]), "unknown joint"),
    ("torque", "torque_command", torque(["left_joint_1", "left_joint_2"], [0.1, math.nan]), "not a number"),
    ("torque", "torque_command", torque(["left_joint_1"], [50.0]), "over limit"),
    ("torque", "external_wrench", wrench("P7"), "unknown frame"),
    ("torque", "external_wrench", wrench(""), "unknown frame"),
    ("torque", "external_wrench", wrench("P0_aligned_aligned"), "unknown frame"),
    ("torque", "external_wrench", wrench("P0", force=(0.0, math.nan, 0.0)), "not a number"),
    ("torque", "external_wrench", wrench("P0", moment=(-math.inf, 0.0, 0.0)), "infinite"),
]


@pytest.mark.parametrize(("drive", "topic", "cdr", "reason"), REFUSED)
def test_a_bad_command_changes_nothing_and_is_counted(run, drive, topic, cdr, reason):
    twin, collected = run(RailScene(drive=drive))
    inputs = twin.simulation.inputs
    before = (np.copy(inputs.pressure), np.copy(inputs.torque), dict(inputs.wrenches))
    said = twin.receive(topic, cdr)
    assert said.startswith(reason)
    assert twin.commands.refused == {reason: 1}
    assert not twin.commands.accepted
    assert np.array_equal(before[1], np.copy(inputs.torque)) or drive == "pressure"
    assert np.array_equal(before[0], np.copy(inputs.pressure)) or drive == "torque"
    assert inputs.wrenches == before[2]
    assert not collected.on(topic)


def test_a_wrench_is_refused_where_the_scene_has_none(run):
    twin, _ = run(RailScene(effects=("arms",)))
    assert twin.receive("external_wrench", wrench("P0")).startswith("effect absent")


def test_one_pressure_is_for_both_arms_and_two_are_left_and_right(run):
    twin, _ = run()
    assert twin.receive("pressure_command", pressure_command([5e4])) is None
    assert twin.simulation.inputs.pressure.tolist() == [5e4, 5e4]
    assert twin.receive("pressure_command", pressure_command([1e4, 2e4])) is None
    assert twin.simulation.inputs.pressure.tolist() == [1e4, 2e4]


def test_joints_that_are_not_named_keep_their_torque(run):
    twin, _ = run(RailScene(drive="torque"))
    assert twin.receive("torque_command", torque(["right_joint_1"], [0.5])) is None
    assert twin.receive("torque_command", torque(["left_joint_2"], [0.25])) is None
    assert twin.simulation.inputs.torque.tolist() == [[0.0, 0.25], [0.5, 0.0]]


def test_what_was_applied_is_emitted_as_it_came_with_the_time_of_its_effect(run):
    twin, collected = run()
    twin.advance_to(0.1)
    cdr = pressure_command([5e4])
    twin.receive("pressure_command", cdr)
    assert collected.on("pressure_command") == [
        ("pressure_command", "std_msgs/msg/Float64MultiArray", cdr, 100_000_000)
    ]


def test_an_unknown_topic_is_a_mistake_of_the_caller(run):
    twin, _ = run()
    with pytest.raises(KeyError):
        twin.receive("nodes", b"")


def test_refusals_are_told_in_the_diagnostics(run):
    twin, collected = run()
    twin.receive("pressure_command", pressure_command([math.nan]))
    twin.advance_to(0.0)
    entries = decode("diagnostic_msgs/msg/DiagnosticArray", collected.on("/diagnostics")[0][2]).status
    commands = next(entry for entry in entries if entry.name == "ldcs_sim: commands")
    values = {pair.key: pair.value for pair in commands.values}
    assert values["refused"] == "1"
    assert values["refused, not a number"] == "1"
    assert "not a number" in commands.message


def test_a_pressure_that_arrives_while_the_tracker_is_late_takes_effect_then_and_there(run):
    tracker = {"points": ["P0"], "rate": 80.0, "delay": 0.005}
    twin, collected = run(RailScene(sensors={"tracker": tracker}))
    while twin.next_time <= 0.0051:
        twin.advance_to_next()
    twin.receive("pressure_command", pressure_command([5e4]))
    assert twin.simulation.time == twin.time == 0.005
    assert collected[-1][3] == 5_000_000


def test_a_stored_command_is_what_the_messages_module_writes():
    cdr = wrench_command(5, "P1", (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    message = decode("geometry_msgs/msg/WrenchStamped", cdr)
    assert message.header.frame_id == "P1"
    assert (message.wrench.force.z, message.wrench.torque.x) == (3.0, 4.0)


def arms(sequence, names, *, pressures=(), torques=()):
    message = message_class("ldcs_msgs/msg/ArmCommand")(
        header=header(0, ""),
        sequence=sequence,
        arms=list(names),
        pressures=np.array(pressures, dtype=float),
        torques=np.array(torques, dtype=float),
    )
    return encode(message)


def test_an_arm_command_names_its_arms_and_is_recorded_as_what_it_amounts_to(run):
    twin, collected = run()
    assert twin.receive("arm_command", arms(1, ["right"], pressures=[5e4])) is None
    assert twin.receive("arm_command", arms(2, ["right", "left"], pressures=[6e4, 7e4])) is None
    assert twin.simulation.inputs.pressure.tolist() == [7e4, 6e4]
    assert [decode(m[1], m[2]).data.tolist() for m in collected] == [[0.0, 5e4], [7e4, 6e4]]
    assert not collected.on("arm_command")


def test_torques_of_some_joints_only_are_of_the_wrong_size(run):
    twin, _ = run(RailScene("torque"))
    refusal = twin.receive("arm_command", arms(1, ["left", "right"], torques=[0.1, 0.2, 0.3]))
    assert "wrong size" in refusal and "got 3 values for 2 arms, expected 2 or 4" in refusal


def test_the_first_arm_command_may_have_the_number_zero(run):
    twin, _ = run()
    assert twin.receive("arm_command", arms(0, ["left"], pressures=[1e4])) is None
    assert twin.receive("arm_command", arms(0, ["left"], pressures=[2e4])).startswith("out of order")


def test_an_arm_command_gives_torques_by_arm_or_by_joint(run):
    twin, _ = run(RailScene(drive="torque"))
    assert twin.receive("arm_command", arms(1, ["right"], torques=[0.5])) is None
    assert twin.receive("arm_command", arms(2, ["left"], torques=[0.1, 0.2])) is None
    assert twin.simulation.inputs.torque.tolist() == [[0.1, 0.2], [0.5, 0.5]]


@pytest.mark.parametrize(
    ("cdr", "reason"),
    [
        (arms(5, ["left"], pressures=[1.0]), "out of order"),
        (arms(6, ["middle"], pressures=[1.0]), "unknown arm"),
        (arms(6, [], pressures=[1.0]), "wrong size"),
        (arms(6, ["left", "left"], pressures=[1.0, 2.0]), "wrong size"),
        (arms(6, ["left"], pressures=[1.0, 2.0]), "wrong size"),
        (arms(6, ["left", "right"], pressures=[1.0]), "wrong size"),
        (arms(6, ["left"]), "wrong size"),
        (arms(6, ["left"], pressures=[1.0], torques=[1.0]), "wrong size"),
        (arms(6, ["left"], torques=[1.0]), "effect absent"),
        (arms(6, ["left"], pressures=[math.nan]), "not a number"),
        (arms(6, ["left"], pressures=[9e9]), "over limit"),
    ],
)
def test_a_bad_arm_command_changes_nothing(run, cdr, reason):
    twin, _ = run()
    assert twin.receive("arm_command", arms(5, ["left"], pressures=[1e4])) is None
    assert twin.receive("arm_command", cdr).startswith(reason)
    assert twin.simulation.inputs.pressure.tolist() == [1e4, 0.0]
    assert twin.receive("arm_command", arms(6, ["left"], pressures=[2e4])) is None


def test_a_sender_that_starts_again_is_heard_after_rearming(run):
    twin, _ = run()
    twin.receive("arm_command", arms(50, ["left"], pressures=[1e4]))
    assert twin.receive("arm_command", arms(1, ["left"], pressures=[1e4])).startswith("out of order")
    twin.rearm()
    assert twin.receive("arm_command", arms(1, ["left"], pressures=[1e4])) is None

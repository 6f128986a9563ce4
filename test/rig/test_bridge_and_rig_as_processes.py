"""Bridge and mock rig as processes on the graph: live, shadow, mirror, a fault, Ctrl-C, bags."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import pytest
import yaml
from rig_bench import LIMIT, SMALL, THREE, WORKING

from ldcs_ros.bags import read_bag
from ldcs_ros.rig.limits import Limits

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
sys.path.insert(0, str(Path(__file__).parents[1] / "ros"))

from processes import Pair

pytestmark = pytest.mark.timed

LIMITS = Limits()


@pytest.fixture
def pair(tmp_path):
    """Start a rig on a transport and a bridge to it; both end with the test."""
    running = []
    scene = tmp_path / "small.yaml"
    scene.write_text(yaml.safe_dump(SMALL))

    def begin(transport, **options):
        running.append(Pair(tmp_path, transport, scene, **options))
        return running[-1]

    yield begin
    for one in running:
        one.close()


# Fault, its value, and what the operator reads: entry and words.
ON_TOPICS = [
    ("duplicates", 5, "readings", "duplicate"),
    ("clock_jump", 2.0, "clocks", "jumped by"),
    ("mute", True, "gate", "the rig is silent"),
    ("delay", 0.6, "readings", "old"),
    ("leak", "right", "gate", "right too low: leak"),
    ("nan", "left", "gate", "pressure of left is"),
    ("drop", True, "gate", "the rig is silent"),
    ("stuck", "left", "gate", "left"),
]
ON_WIRES = {"modbus": [("drop", True, "links", "valve island")], "serial": [("mute", True, "gate", "silent")]}
HARMLESS = ("duplicates", "clock_jump")
# Reasons for a vent on a machine that starves the rig, the bridge or the operator.
STARVED = ("the rig is silent", "too low", "no command", "s late")


def has_come(run, entry, words):
    """Whether any diagnostics message since the last clearing says so."""
    return any(
        words in status.message
        for message in run.user.received["/diagnostics"]
        for status in message.status
        if status.name.endswith(f": {entry}")
    )


def bring_to_pressure(run):
    """Arm and command until the chambers have the working pressure; False for a vent before that."""
    run.arm()
    run.user.received["/diagnostics"].clear()
    run.operator = [WORKING, WORKING]
    run.user.until(lambda: min(run.chambers()[:2]) > 0.9 * WORKING or has_come(run, "gate", "vented"), 10.0)
    if min(run.chambers()[:2]) > 0.9 * WORKING:
        return True
    run.operator = None
    return False


def break_and_watch(run, fault, value, entry, words):
    """Bring it to pressure, break it, and see what the operator sees and how soon it is vented.

    A machine that starves the rig or the bridge for longer than a time limit has it vent for that reason, rightly
    and in time: then the same fault once more.
    """
    for _ in range(8):
        if bring_to_pressure(run) and _is_seen(run, fault, value, entry, words):
            return
        run.break_rig(fault, type(value)())
    raise AssertionError(f"it vents each time before the fault shows: {run.seen()}")


def _is_seen(run, fault, value, entry, words):
    """Break it, check the vent, and return whether the operator reads of this fault."""
    run.user.received["/diagnostics"].clear()
    run.break_rig(fault, value)
    arm = slice(0, 2)
    if fault == "stuck":
        run.operator, arm = [0.4 * WORKING, 0.4 * WORKING], slice(1, 2)
    elif fault in HARMLESS:
        run.user.until(lambda: has_come(run, entry, words), 3.0)
        run.operator = None
    began = time.monotonic()
    run.user.until(lambda: max(run.chambers()[arm]) < 0.05 * LIMIT, 5.0)
    # Discovery of a fault, and a machine that is busy with other things, may take a moment.
    assert time.monotonic() - began < LIMITS.command_timeout + LIMITS.vent_time + 0.3
    _, _, peak, lowest, highest = run.chambers()
    assert peak <= LIMIT and lowest >= 0.0 and highest <= LIMIT
    run.user.until(lambda: has_come(run, "gate", "vented"), 3.0)
    end = time.monotonic() + 1.0
    while not has_come(run, entry, words) and time.monotonic() < end:
        run.user.spin(0.05)
    run.operator = None
    if has_come(run, entry, words):
        return True
    assert any(has_come(run, "gate", reason) for reason in STARVED), "vented, and the fault is not told"
    return False


@pytest.mark.timeout(300)
def test_each_fault_on_the_graph_is_seen_and_vents_in_time(pair):
    run = pair("topics", mode="live")
    for fault, value, entry, words in ON_TOPICS:
        try:
            break_and_watch(run, fault, value, entry, words)
        except AssertionError as error:
            raise AssertionError(f"{fault}: {run.seen()}") from error
        run.break_rig(fault, type(value)())
    assert run.bridge.interrupt() == 0
    assert run.rig.interrupt() == 0


@pytest.mark.parametrize("transport", ON_WIRES)
def test_a_fault_on_a_wire_is_seen_and_vents_in_time(pair, transport):
    run = pair(transport, mode="live")
    for fault, value, entry, words in ON_WIRES[transport]:
        break_and_watch(run, fault, value, entry, words)
        run.break_rig(fault, type(value)())
    assert run.seen()["gate"][2]["clipped by the output stage"] == "0"
    run.user.until(lambda: run.seen()["links"][0] == 0, 5.0)
    assert run.bridge.interrupt() == 0
    assert run.rig.interrupt() == 0


def test_an_end_without_a_confirmed_zero_is_no_success(pair):
    run = pair("modbus", mode="live")
    run.arm()
    run.break_rig("drop", True)
    run.user.until(lambda: has_come(run, "links", "valve island"), 5.0)
    assert run.bridge.interrupt() == 1
    last = run.bridge.log.read_text().splitlines()[-1]
    assert "no zero was confirmed" in last and "cut the supply" in last


def test_shadow_listens_records_two_bags_and_commands_nothing(pair, tmp_path):
    record = tmp_path / "shadow"
    run = pair("modbus", mode="shadow", controller="wave", record=record, duration=4.0)
    run.operator = [WORKING, WORKING]
    assert run.bridge.process.wait(30.0) == 0
    text = (tmp_path / "bridge.log").read_text()
    assert "shadow, listening" in text
    twin, rig = read_bag(record / "twin"), read_bag(record / "rig")
    assert twin.counts["/ldcs/nodes"] > 150 and twin.counts["/ldcs/pressure_command"] > 10
    assert rig.counts["/ldcs/left/pressure"] > 100 and rig.counts["/ldcs/pressure_command"] > 10
    assert rig.counts["/ldcs/raw/modbus/received"] > 100
    # Function codes 6 and 16 write; a shadow only ever reads (3 and 4).
    sent = rig.channels["/ldcs/raw/modbus/sent"].messages
    assert {bytes(message.data)[7] for message in sent} == {3, 4}
    assert rig.counts["/ldcs/P1/pose"] > 20 and twin.counts["/ldcs/residual/P1"] > 20
    assert "limits" in rig.custom_data["rig"]


@pytest.mark.slow
def test_mirror_finds_what_the_twin_does_not_know(pair):
    run = pair("topics", mode="mirror", controller="wave")
    run.user.listen("/ldcs/estimate/nodes", "sensor_msgs/PointCloud2")
    run.user.listen("/ldcs/estimate/P1/pose", "geometry_msgs/PoseWithCovarianceStamped")

    def is_found():
        values = run.seen().get("estimate", (0, "", {}))[2]
        if "gain" not in values:
            return False
        gain, stiffness = (float(values[name].split()[0]) for name in ("gain", "stiffness"))
        return abs(gain - 0.85) < 0.05 and abs(stiffness - 1.2) < 0.1

    run.user.until(is_found, 20.0)
    assert run.user.received["/ldcs/estimate/nodes"]
    pose = run.user.received["/ldcs/estimate/P1/pose"][-1].pose
    assert 0.0 < pose.covariance[0] ** 0.5 < 1e-3
    answer = run.call("arm")
    assert not answer.success and "mirror commands nothing" in answer.message


def test_bad_input_is_one_line_and_exit_status_two(tmp_path):
    from processes import Process, own_domain

    three_arms = tmp_path / "three_arms.yaml"
    three_arms.write_text(yaml.safe_dump(THREE))
    for parameters, words in (
        ({}, "got no rig"),
        ({"rig": "nowhere.yaml"}, "no rig 'nowhere.yaml'"),
        ({"rig": "controller_topics", "mode": "lively"}, "unknown mode 'lively'"),
        ({"rig": "controller_topics", "publish_rate": 0.0}, "publish_rate"),
        ({"rig": "controller_topics", "scene": three_arms}, "those of the scene"),
    ):
        node = Process("bridge", tmp_path / "bad.log", own_domain(), **parameters)
        try:
            assert node.process.wait(20.0) == 2
        finally:
            node.end()
        lines = (tmp_path / "bad.log").read_text().strip().splitlines()
        assert len(lines) == 1 and lines[0].startswith("bridge: ") and words in lines[0]


def test_the_walk_through_names_what_there_is():
    from argparse import ArgumentParser
    from importlib import import_module

    from ldcs_ros.cli.main import VERBS
    from ldcs_ros.mock_rig.faults import Faults
    from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS

    root = Path(__file__).parents[2]
    text = (
        (root / "README.md")
        .read_text(encoding="utf-8")
        .split("## A rig beside the twin")[1]
        .split("\n## ")[0]
    )
    for line in re.findall(r"^ +ldcs (.*)$", text, re.MULTILINE):
        verb, *words = line.split()
        parser = ArgumentParser(exit_on_error=False)
        import_module(VERBS[verb].module).add_arguments(parser)
        parser.parse_args(words)
    for node, known in (("mock_rig", MOCK_RIG_PARAMETERS), ("bridge", BRIDGE_PARAMETERS)):
        (line,) = re.findall(rf"^ +{node} --ros-args (.*)$", text, re.MULTILINE)
        assert set(re.findall(r"-p (\w+):=", line)) <= set(known)
    page = (root / "docs/bridge.md").read_text(encoding="utf-8")
    assert set(re.findall(r"`fault_(\w+)`", page)) == set(vars(Faults()))

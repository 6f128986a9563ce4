"""One live node and a plain ROS user: reading, commanding, refusals, pause, step, reset, parameters."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from live import LiveNode, PlainUser, own_domain, stamp
from std_msgs.msg import Float64MultiArray

pytestmark = pytest.mark.timed

PERIOD_NS = 20_000_000


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The rig scene, live for all tests of this file; each leaves it running."""
    domain = own_domain()
    node = LiveNode(tmp_path_factory.mktemp("rig") / "node.log", domain, scene="rig")
    user = PlainUser(domain)
    user.domain = domain
    for topic, kind in (
        ("/ldcs/nodes", "sensor_msgs/PointCloud2"),
        ("/ldcs/truth/P1/pose", "geometry_msgs/PoseStamped"),
        ("/ldcs/left/pressure", "sensor_msgs/FluidPressure"),
        ("/diagnostics", "diagnostic_msgs/DiagnosticArray"),
    ):
        user.listen(topic, kind)
    user.next("/ldcs/nodes")
    yield user
    node.end()
    user.close()


@pytest.fixture(scope="module")
def pressure(rig):
    return rig.publisher("/ldcs/pressure_command", Float64MultiArray)


def test_a_program_without_this_package_reads_the_cloud(rig):
    program = Path(__file__).with_name("plain_reader.py")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(rig.domain), "PYTHONPATH": ""}
    result = subprocess.run(
        [sys.executable, program], env=environment, capture_output=True, text=True, timeout=20, check=True
    )
    seen = json.loads(result.stdout)
    assert seen["size"] == [18, 9]
    assert seen["frame"] == "ldcs_base"
    assert 0.09 < seen["last"][0] < 0.16
    assert seen["ours"] == []


def test_stamps_are_simulation_time_at_the_publish_rate(rig):
    rig.next("/ldcs/nodes")
    clouds = rig.received["/ldcs/nodes"]
    rig.until(lambda: len(clouds) > 10)
    steps = np.diff([stamp(cloud) for cloud in clouds])
    assert set(steps.tolist()) == {PERIOD_NS}


def test_a_pressure_command_reaches_the_arm(rig, pressure):
    pressure.publish(Float64MultiArray(data=[3.0e4, 3.0e4]))
    rig.until(lambda: abs(rig.received["/ldcs/left/pressure"][-1].fluid_pressure - 131325.0) < 1000.0)
    height = rig.next("/ldcs/truth/P1/pose").pose.position.z
    pressure.publish(Float64MultiArray(data=[1.4e5]))
    rig.until(lambda: rig.received["/ldcs/left/pressure"][-1].fluid_pressure > 240000.0)
    rig.spin(0.5)
    assert rig.next("/ldcs/truth/P1/pose").pose.position.z > height + 0.01


def test_bad_commands_are_refused_counted_and_change_nothing(rig, pressure):
    pressure.publish(Float64MultiArray(data=[1.2e5, 1.2e5]))
    before = int(rig.diagnostics("commands")["refused"])
    for data in ([1.0, 2.0, 3.0], [float("nan"), 1.0], [float("inf")], [1e9, 0.0]):
        pressure.publish(Float64MultiArray(data=data))
    health = rig.until(
        lambda: (now := rig.diagnostics("commands")) and int(now["refused"]) == before + 4 and now
    )
    for reason in ("wrong size", "not a number", "infinite", "over limit"):
        assert health[f"refused, {reason}"] == "1"
    assert rig.next("/ldcs/left/pressure").fluid_pressure == pytest.approx(221325.0, abs=2000.0)


def test_pause_stops_time_and_step_is_exactly_one_period(rig):
    assert rig.call("/ldcs/ldcs_sim/pause").success
    rig.spin(0.1)
    rig.received["/ldcs/nodes"].clear()
    rig.spin(0.3)
    assert not rig.received["/ldcs/nodes"]
    for _ in range(3):
        assert rig.call("/ldcs/ldcs_sim/step").success
    clouds = rig.received["/ldcs/nodes"]
    rig.until(lambda: len(clouds) == 3)
    assert np.diff([stamp(cloud) for cloud in clouds]).tolist() == [PERIOD_NS, PERIOD_NS]
    assert rig.diagnostics("simulation")["mode"] == "paused"
    assert rig.call("/ldcs/ldcs_sim/resume").success


def test_resuming_makes_no_burst(rig):
    rig.call("/ldcs/ldcs_sim/pause")
    rig.spin(0.5)
    rig.received["/ldcs/nodes"].clear()
    rig.call("/ldcs/ldcs_sim/resume")
    rig.spin(0.5)
    assert 15 <= len(rig.received["/ldcs/nodes"]) <= 30


def test_step_is_refused_while_running(rig):
    answer = rig.call("/ldcs/ldcs_sim/step")
    assert not answer.success
    assert "paused" in answer.message


def test_reset_goes_back_to_the_start_without_a_restart(rig):
    assert rig.call("/ldcs/ldcs_sim/reset").success
    first = min(stamp(cloud) for cloud in rig.until(lambda: rig.received["/ldcs/nodes"][-5:]))
    rig.until(lambda: stamp(rig.received["/ldcs/nodes"][-1]) < first or first < 10**9)
    assert stamp(rig.next("/ldcs/nodes")) < 2 * 10**9


def test_a_bad_parameter_is_refused_alone_and_refuses_an_atomic_set(rig):
    answer = rig.set_parameters(atomically=True, duration=5000.0, real_time_factor=-0.5)
    assert not answer.result.successful and "real_time_factor" in answer.result.reason
    good, bad = rig.set_parameters(duration=5000.0, real_time_factor=-0.5).results
    assert good.successful and not bad.successful and "real_time_factor" in bad.reason
    good, bad = rig.set_parameters(duration=5000.0, command_timeout=float("nan")).results
    assert good.successful and not bad.successful
    answer = rig.set_parameters(scene="arc")
    assert not answer.results[0].successful


def test_the_pace_can_be_changed_while_running(rig):
    assert rig.set_parameters(real_time_factor=0.2).results[0].successful
    rig.received["/ldcs/nodes"].clear()
    rig.spin(0.6)
    slow = len(rig.received["/ldcs/nodes"])
    rig.set_parameters(real_time_factor=1.0)
    assert 3 <= slow <= 10


def test_markers_come_while_they_have_subscribers(rig):
    rig.listen("/ldcs/surface", "visualization_msgs/Marker")
    rig.listen("/ldcs/loads", "visualization_msgs/MarkerArray")
    surface = rig.next("/ldcs/surface")
    assert (surface.type, len(surface.points) % 3) == (11, 0)
    assert rig.next("/ldcs/loads").markers[0].action == 3


def test_diagnostics_tell_the_truth_about_optional_interfaces(rig):
    from importlib.util import find_spec

    told = rig.diagnostics("interfaces")
    for package in ("tf2_msgs", "simulation_interfaces", "ldcs_msgs", "launch"):
        found = getattr(find_spec(package), "origin", None) is not None
        assert told[package].startswith("not installed") != found
    assert rig.diagnostics("recorder")["message"] == "off"


def test_an_arm_command_of_the_interface_package_is_understood(rig):
    ldcs_msgs = pytest.importorskip("ldcs_msgs.msg", reason="the interface package is not built")
    sender = rig.publisher("/ldcs/arm_command", ldcs_msgs.ArmCommand)
    accepted = int(rig.diagnostics("commands")["accepted"])
    sender.publish(ldcs_msgs.ArmCommand(sequence=1, arms=["left"], pressures=[9.0e4]))
    rig.until(lambda: int(rig.diagnostics("commands")["accepted"]) == accepted + 1)

"""How a node starts and ends: signals, durations, bad input, trouble with the disk."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64MultiArray

NODES = "/ldcs/nodes"


def messages(folder):
    """Topic -> number of messages of a bag, read with nothing of ours; raises if it is not whole."""
    with AnyReader([folder]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        times = [time for _, time, _ in reader.messages()]
    assert times == sorted(times)
    return counts


def test_ctrl_c_twice_vents_closes_the_bag_and_exits_0(start, tmp_path):
    node, user = start(scene="rig", record=tmp_path / "bag")
    user.listen(NODES, "sensor_msgs/PointCloud2")
    user.publisher("/ldcs/pressure_command", Float64MultiArray).publish(Float64MultiArray(data=[1e5]))
    user.until(lambda: len(user.received[NODES]) > 20)
    assert node.stop(signal.SIGINT, signal.SIGINT) == 0
    counts = messages(tmp_path / "bag")
    assert counts[NODES] > 20
    for topic in ("truth/P0/pose", "P1/pose", "joint_states", "left/pressure", "trakstar_msg"):
        assert counts[f"/ldcs/{topic}"] > 10
    assert counts["/diagnostics"] >= 1
    with AnyReader([tmp_path / "bag"]) as reader:
        commands = [c for c in reader.connections if c.topic == "/ldcs/pressure_command"]
        sent = [reader.deserialize(raw, c.msgtype).data.tolist() for c, _, raw in reader.messages(commands)]
    assert sent[0] == [1e5]
    assert sent[-1] == [0.0, 0.0]
    assert "Traceback" not in node.output


def test_sigterm_ends_it_as_cleanly(start, tmp_path):
    node, user = start(scene="paper", record=tmp_path / "bag")
    user.listen(NODES, "sensor_msgs/PointCloud2")
    user.next(NODES)
    assert node.stop(signal.SIGTERM) == 0
    assert messages(tmp_path / "bag")[NODES] > 0


def test_as_fast_as_possible_to_the_end_of_the_duration(start, tmp_path):
    node, _ = start(
        with_user=False, scene="paper", real_time_factor=-1.0, duration=5.0, record=tmp_path / "bag"
    )
    assert node.process.wait(20.0) == 0
    assert messages(tmp_path / "bag")[NODES] == 251


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"scene": "papre"}, "paper"),
        ({"publish_rate": 0.0}, "publish_rate"),
        ({"real_time_factor": 0.0}, "real_time_factor"),
        ({"duration": "soon"}, "duration"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(start, parameters, named):
    node, _ = start(with_user=False, **parameters)
    assert node.process.wait(20.0) == 2
    assert named in node.output.strip().splitlines()[-1]
    assert "Traceback" not in node.output


def test_a_bag_folder_that_exists_is_left_alone_and_the_twin_runs_on(start, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine").write_text("keep")
    node, user = start(scene="paper", record=tmp_path / "bag")
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    health = user.diagnostics("recorder")
    assert health["level"] == 2
    assert "exists" in health["message"]
    assert (tmp_path / "bag" / "mine").read_text() == "keep"
    assert node.stop(signal.SIGINT) == 0


def test_a_silent_sender_is_vented_and_must_rearm(start):
    node, user = start(scene="rig", command_timeout=0.3)
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    user.listen("/ldcs/left/pressure", "sensor_msgs/FluidPressure")
    sender = user.publisher("/ldcs/pressure_command", Float64MultiArray)
    sender.publish(Float64MultiArray(data=[1e5]))
    user.until(lambda: user.diagnostics("watchdog")["message"].startswith("tripped"))
    sender.publish(Float64MultiArray(data=[1e5]))
    user.until(lambda: user.diagnostics("commands").get("refused, vented") == "1")
    assert user.next("/ldcs/left/pressure").fluid_pressure < 111325.0
    assert user.call("/ldcs/ldcs_sim/rearm").success
    sender.publish(Float64MultiArray(data=[1e5]))
    user.until(lambda: user.next("/ldcs/left/pressure").fluid_pressure > 111325.0)


def test_a_node_that_does_not_start_by_itself_is_driven_by_its_lifecycle(start):
    from lifecycle_msgs.msg import Transition

    node, user = start(scene="single_spring", autostart=False)
    user.listen(NODES, "sensor_msgs/PointCloud2")
    assert not user.call("/ldcs/ldcs_sim/pause").success

    change = user.change_state
    for _ in range(2):
        assert change(Transition.TRANSITION_CONFIGURE)
        assert change(Transition.TRANSITION_ACTIVATE)
        user.next(NODES)
        assert change(Transition.TRANSITION_DEACTIVATE)
        assert not user.call("/ldcs/ldcs_sim/resume").success
        assert change(Transition.TRANSITION_CLEANUP)
    assert change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert node.process.wait(10.0) == 0


def test_a_signal_while_it_loads_ends_it_without_a_traceback(start):
    for delay in (0.2, 0.35, 0.5, 0.7):
        node, _ = start(with_user=False, scene="paper")
        time.sleep(delay)
        assert node.stop(signal.SIGINT) == 0
        assert "Traceback" not in node.output


def test_a_parameter_with_a_slip_in_its_name_is_told(start):
    node, _ = start(
        with_user=False, scene="single_spring", real_time_factor=-1.0, duration=0.1, publish_rat=5.0
    )
    assert node.process.wait(20.0) == 0
    assert "publish_rate" in node.output


def test_arguments_that_ros_refuses_are_one_line_and_exit_2(tmp_path):
    command = [sys.executable, "-m", "ldcs_ros.ros", "sim", "--ros-args", "-p", "scene"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=20)
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1].startswith("sim: ")
    assert "Traceback" not in result.stderr

"""Start and end of a node: signals, durations, bad input, trouble with the disk."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
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
    node, _ = start(with_user=False, scene="paper", real_time_factor=-1, duration=5, record=tmp_path / "bag")
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


def test_a_run_that_cannot_begin_its_recording_ends_at_once_with_status_2(start, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine").write_text("keep")
    node, _ = start(with_user=False, scene="single_spring", record=tmp_path / "bag")
    assert node.process.wait(30.0) == 2
    assert "exists already" in node.output.strip().splitlines()[-1]
    assert "Traceback" not in node.output
    assert (tmp_path / "bag" / "mine").read_text() == "keep"


def test_a_node_whose_bag_is_removed_tells_it_saves_the_rest_and_ends_with_status_1(start, tmp_path):
    node, user = start(scene="single_spring", record=tmp_path / "bag")
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    user.until(lambda: user.diagnostics("recorder")["message"] == "recording")
    shutil.rmtree(tmp_path / "bag")
    user.until(lambda: user.diagnostics("recorder")["level"] == 2)
    assert "bag_rest1" in user.diagnostics("recorder")["message"]
    assert node.stop(signal.SIGINT) == 1
    assert messages(tmp_path / "bag_rest1")[NODES] > 5
    assert "Traceback" not in node.output


@pytest.mark.timed
def test_a_silent_sender_is_vented_and_must_rearm(start):
    _node, user = start(scene="rig", command_timeout=0.3)
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


@pytest.mark.timed
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


def run_program(*words, domain="214"):
    environment = {**os.environ, "ROS_DOMAIN_ID": domain}
    command = [sys.executable, "-m", "ldcs_ros.ros", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, env=environment)


@pytest.mark.parametrize("program", ["sim", "bridge", "mock_rig", "live_view"])
def test_help_is_printed_and_nothing_is_started(program):
    done = run_program(program, "--help")
    assert done.returncode == 0 and not done.stderr
    assert done.stdout.startswith(f"usage: {program}")
    expected = {"sim": "publish_rate", "bridge": "rig", "mock_rig": "rig_file", "live_view": "--namespace"}
    assert expected[program] in done.stdout


@pytest.mark.parametrize("program", ["sim", "bridge", "mock_rig", "live_view"])
@pytest.mark.parametrize(
    ("word", "right"),
    [("scene:=rig", "--ros-args -p scene:=rig"), ("__ns:=/a", "--ros-args -r __ns:=/a"), ("rig", "--help")],
)
def test_a_word_that_ros_would_drop_is_refused_with_the_right_form(program, word, right):
    done = run_program(program, word)
    assert done.returncode == 2
    assert right in done.stderr and done.stderr.count("\n") == 1


def test_dumped_parameters_load_again_one_by_one(start):
    from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters

    _node, user = start(
        scene="single_spring", **{"qos_overrides./ldcs/nodes.publisher.reliability": "best_effort"}
    )
    base = "/ldcs/ldcs_sim"
    names = user.call(f"{base}/list_parameters", ListParameters).result.names
    assert "qos_overrides./ldcs/nodes.publisher.reliability" in names and "scene" in names
    values = user.call(f"{base}/get_parameters", GetParameters, GetParameters.Request(names=names)).values
    parameters = [ParameterMessage(name=name, value=value) for name, value in zip(names, values, strict=True)]
    request = SetParameters.Request(parameters=parameters)
    results = user.call(f"{base}/set_parameters", SetParameters, request).results
    assert [result.reason for result in results if not result.successful] == []
    # One that cannot be set keeps none of the others from being set.
    assert user.set_parameters(command_timeout=3).results[0].successful  # a whole number for a double
    first, second, third = user.set_parameters(seed=5.0, wrench_timeout=2.5, scene="paper").results
    assert (first.successful, second.successful, third.successful) == (False, True, False)
    assert first.reason and "scene" in third.reason

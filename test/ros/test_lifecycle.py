"""The lifecycle of the live node as its users drive it: another scene, a whole bag, silence while inactive."""

from __future__ import annotations

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
from live import stamp
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64MultiArray

NODES = "/ldcs/nodes"
CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE


def state_of(user):
    return user.call("/ldcs/ldcs_sim/get_state", GetState).current_state.id


def test_a_cleaned_up_node_left_a_whole_bag_and_takes_another_scene(start, tmp_path):
    node, user = start(scene="single_spring", record=tmp_path / "first", graph_folder=tmp_path)
    user.listen(NODES, "sensor_msgs/PointCloud2")
    width = user.next(NODES).width
    assert not user.set_parameters(scene="hanging_sheet").results[0].successful
    assert user.change_state(DEACTIVATE)
    refusal = user.set_parameters(scene="hanging_sheet").results[0]
    assert not refusal.successful and "clean up" in refusal.reason
    assert user.change_state(CLEANUP)
    with AnyReader([tmp_path / "first"]) as reader:
        assert {connection.topic: connection.msgcount for connection in reader.connections}[NODES] > 0

    assert user.set_parameters(scene="no_such_scene").results[0].successful
    assert not user.change_state(CONFIGURE)
    assert state_of(user) == State.PRIMARY_STATE_UNCONFIGURED
    second = {"scene": "hanging_sheet", "record": str(tmp_path / "second")}
    assert all(result.successful for result in user.set_parameters(**second).results)
    assert user.change_state(CONFIGURE) and user.change_state(ACTIVATE)
    assert user.next(NODES).width > width
    assert user.change_state(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert node.process.wait(10.0) == 0
    with AnyReader([tmp_path / "second"]) as reader:
        assert NODES in reader.topics
    assert "no_such_scene" in node.output and "Traceback" not in node.output


def test_an_inactive_node_stands_still_and_refuses_commands_and_goes_on_where_it_stood(start):
    _node, user = start(scene="rig")
    user.listen(NODES, "sensor_msgs/PointCloud2")
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    sender = user.publisher("/ldcs/pressure_command", Float64MultiArray)
    user.until(lambda: len(user.received[NODES]) > 10)
    assert user.change_state(DEACTIVATE)
    user.spin(0.3)
    last = stamp(user.received[NODES][-1])
    user.received[NODES].clear()
    sender.publish(Float64MultiArray(data=[1e5]))
    commands = user.until(
        lambda: (now := user.diagnostics("commands")) and now.get("refused, inactive") == "1" and now
    )
    assert commands["accepted"] == "0" and "activate" in commands["message"]
    assert not user.received[NODES]
    assert user.change_state(ACTIVATE)
    user.until(lambda: user.received[NODES])
    assert stamp(user.received[NODES][0]) - last == 20_000_000
    sender.publish(Float64MultiArray(data=[1e5]))
    user.until(lambda: user.diagnostics("commands")["accepted"] == "1")

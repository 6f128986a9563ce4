"""A bag of the live node, commanded over DDS, replays in process to the same bytes."""

from __future__ import annotations

import signal

import pytest
from std_msgs.msg import Float64MultiArray

from ldcs_ros.bags import read_bag
from ldcs_ros.replay.session import replay


@pytest.mark.timed
def test_a_bag_of_the_live_node_replays_to_the_same_bytes(start, tmp_path):
    node, user = start(scene="rig", record=str(tmp_path / "live"), command_timeout=0.3, publish_rate=60.0)
    publisher = user.publisher("/ldcs/pressure_command", Float64MultiArray)
    for k in range(6):
        publisher.publish(Float64MultiArray(data=[1e4 * k, 5e4]))
        user.spin(0.07)
    user.spin(0.6)
    node.stop(signal.SIGINT)
    commands = read_bag(tmp_path / "live").channels["/ldcs/pressure_command"]
    assert len(commands) > 20, "six commands and a vented ramp"
    done = replay(tmp_path / "live", tmp_path / "again")
    assert done.verdict.same_bytes, done.verdict
    assert done.outcome.applied == len(commands)

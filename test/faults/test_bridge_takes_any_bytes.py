"""Bytes that are no command reach the bridge: refused, counted, and the bridge goes on."""

from __future__ import annotations

import time
from collections import deque

from ldcs_ros import load_scene
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.mock_rig.topics import Topics
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import Mode
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.ros.rig.rig_bridge import RigBridge

JUNK = (b"", b"\0", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff\xff", pressure_command([1e5])[:-3], b"\xff" * 40)


def test_the_bridge_counts_bytes_that_are_no_command_and_goes_on():
    bridge = Bridge(load_scene("rig"), load_rig("controller_topics"), mode=Mode.SHADOW, clock=time.monotonic)
    node = RigBridge.__new__(RigBridge)
    heard = time.monotonic()
    node._bridge, node._commands = bridge, deque((heard, cdr) for cdr in [*JUNK, pressure_command([1e5])])
    node._forward()
    assert bridge.gate.refused == {"malformed": len(JUNK), "mode": 1}
    assert bridge.gate.last_refusal.startswith("mode: ")


def test_the_mock_rig_ignores_bytes_that_are_no_command():
    rig = MockRig(load_scene("rig"), controller="remote", clock=time.monotonic)
    topics = Topics(rig, lambda topic, kind, cdr: None)
    for cdr in JUNK:
        topics.receive(cdr)
    assert rig.highest_setpoint == 0.0

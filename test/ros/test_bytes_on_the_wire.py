"""rclpy decodes the messages that the twin encodes without ROS, for every topic."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from fake_scene import Collector
from rclpy.serialization import deserialize_message, serialize_message

from ldcs_ros import load_scene
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.ros.common.optional import installed, message_type
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin


def same(ours, theirs):
    """Compare a decoded message with rclpy's, field by field and number by number."""
    if hasattr(theirs, "get_fields_and_field_types"):
        return all(
            same(getattr(ours, name), getattr(theirs, name)) for name in theirs.get_fields_and_field_types()
        )
    if isinstance(theirs, (str, bool, int, float)):
        return ours == theirs
    if isinstance(theirs, bytes):
        return ours == ord(theirs)
    if len(theirs) and hasattr(theirs[0], "get_fields_and_field_types"):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    return np.array_equal(np.asarray(ours), np.asarray(theirs))


@pytest.fixture(scope="module")
def emitted():
    collected = Collector()
    twin = Twin(
        load_scene("rig"),
        RunSettings(publish_clock=True, publish_tf=installed()["tf2_msgs"]),
        sinks=[collected],
        has_subscribers=lambda name: True,
    )
    twin.receive("pressure_command", pressure_command([1e5, 1.2e5]))
    twin.advance_to(0.1)
    return {topic: (kind, cdr) for topic, kind, cdr, _ in collected if find_spec(kind.split("/")[0])}


def test_rclpy_reads_in_every_message_what_was_written(emitted):
    assert len(emitted) >= 14
    for topic, (kind, cdr) in emitted.items():
        assert same(decode(kind, cdr), deserialize_message(cdr, message_type(kind))), topic


def test_every_message_survives_rclpy_unchanged(emitted):
    for topic, (kind, cdr) in emitted.items():
        again = serialize_message(deserialize_message(cdr, message_type(kind)))
        assert same(decode(kind, bytes(again)), deserialize_message(cdr, message_type(kind))), topic

"""The twin's message types are those of ROS 2, and nothing loads the rest."""

from __future__ import annotations

import subprocess
import sys

from rosbags.typesys import Stores, get_typestore

from ldcs_ros.messages.cdr import message_class, typestore
from ldcs_ros.messages.ros_types import ros_types
from ldcs_ros.messages.topics import TOPICS


def test_the_types_are_those_of_ros_2():
    kilted = get_typestore(Stores.ROS2_KILTED)
    types = ros_types()
    assert types == {name: kilted.fielddefs[name] for name in types}
    for name in types:
        assert typestore(name).hash_rihs01(name) == kilted.hash_rihs01(name)


def test_every_topic_has_its_type_without_the_others():
    program = """
import sys
from ldcs_ros.messages.cdr import message_class
from ldcs_ros.messages.topics import TOPICS
for topic in TOPICS.values():
    message_class(topic.type)
loaded = [name for name in sys.modules if name.startswith("rosbags.typesys.stores.ros2")]
assert not loaded, loaded
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
    assert len(TOPICS) > 8


def test_other_types_are_found_too():
    assert message_class("sensor_msgs/msg/CompressedImage").__msgtype__ == "sensor_msgs/msg/CompressedImage"

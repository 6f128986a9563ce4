"""Recordings: written while a run goes on, read back from any ROS 2 bag, repaired after a kill."""

from __future__ import annotations

from ldcs_ros.bags.reader import read_bag
from ldcs_ros.bags.recording import Channel, Message, Recording
from ldcs_ros.bags.recovery import RecoveryReport, recover
from ldcs_ros.bags.topics import Qos, TopicInfo
from ldcs_ros.bags.writer import BagWriter

__all__ = [
    "BagWriter",
    "Channel",
    "Message",
    "Qos",
    "Recording",
    "RecoveryReport",
    "TopicInfo",
    "read_bag",
    "recover",
]

"""Recordings: written while a run goes on, read back from any ROS 2 bag, repaired after a kill."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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

_HOMES = {
    "BagWriter": "writer",
    "Channel": "recording",
    "Message": "recording",
    "Qos": "topics",
    "Recording": "recording",
    "RecoveryReport": "recovery",
    "TopicInfo": "topics",
    "read_bag": "reader",
    "recover": "recovery",
}


def __getattr__(name: str) -> object:
    # Loaded at first use: messages need the definitions of types, not the readers and writers of files.
    if name not in _HOMES:
        raise AttributeError(f"module 'ldcs_ros.bags' has no attribute {name!r}")
    return getattr(importlib.import_module(f"ldcs_ros.bags.{_HOMES[name]}"), name)

"""Messages that the recording tests write."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).parent))

POSE = "geometry_msgs/msg/PoseStamped"


@pytest.fixture(scope="session")
def make_pose() -> Callable[[float], bytes]:
    """x [m] -> CDR of a PoseStamped at that place."""
    store = get_typestore(Stores.ROS2_KILTED)

    def build(x: float) -> bytes:
        types = store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "ldcs_base")
        point = types["geometry_msgs/msg/Point"](x, 0.0, 0.0)
        upright = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        place = types["geometry_msgs/msg/Pose"](point, upright)
        return bytes(store.serialize_cdr(types[POSE](header, place), POSE))

    return build

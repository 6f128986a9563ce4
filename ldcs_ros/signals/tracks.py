"""Tracks: what pictures need out of a Recording, as arrays over time [s], in ldcs_base and SI units.

Topics are found by the end of their name and their type, so a namespace in front does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import RecordingError

CLOUD = "sensor_msgs/msg/PointCloud2"
POSE = "geometry_msgs/msg/PoseStamped"
JOINTS = "sensor_msgs/msg/JointState"
PRESSURE = "sensor_msgs/msg/FluidPressure"

# A stamp beyond this is a wall clock, not a simulation time: count from the recording's start instead.
_WALL_CLOCK = 10 * 365 * 86_400 * 1_000_000_000


@dataclass(frozen=True)
class Track:
    """Values over time.

    Attributes:
        time: Times [s], shape (n,), rising.
        value: Values, shape (n, ...).
    """

    time: np.ndarray
    value: np.ndarray

    @property
    def first(self) -> np.ndarray:
        """The first value."""
        value: np.ndarray = self.value[0]
        return value

    @property
    def last(self) -> np.ndarray:
        """The last value."""
        value: np.ndarray = self.value[-1]
        return value


class SurfaceTrack:
    """The recorded surface over time; a cloud is unpacked only when it is asked for.

    Attributes:
        time: Times of the clouds [s], shape (n,).
        nodes: Nodes along x and y.
    """

    def __init__(self, channel: Any, start: int) -> None:
        self._messages: Sequence[Any] = channel.messages
        first = self._messages[0]
        self.nodes: tuple[int, int] = (first.height // 2, first.width)
        self.time = seconds(np.asarray(channel.times), start)

    def __len__(self) -> int:
        return len(self.time)

    def index(self, time: float) -> int:
        """Return the index of the cloud nearest to a time [s]."""
        return int(np.argmin(np.abs(self.time - time)))

    def position(self, index: int) -> np.ndarray:
        """Return node positions of one cloud [m], shape (2, nx, ny, 3): layer (bottom, top), i, j."""
        return cloud_positions(self._messages[index]).reshape(2, *self.nodes, 3)


def cloud_positions(cloud: Any) -> np.ndarray:
    """Return x, y, z of every point of a PointCloud2 [m], shape (n, 3), as float64."""
    offsets = {field.name: field.offset for field in cloud.fields}
    order = ">" if cloud.is_bigendian else "<"
    layout = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [f"{order}f4"] * 3,
            "offsets": [offsets[axis] for axis in "xyz"],
            "itemsize": cloud.point_step,
        }
    )
    points = np.frombuffer(bytes(cloud.data), dtype=layout, count=cloud.width * cloud.height)
    return np.stack([points[axis] for axis in "xyz"], axis=-1).astype(np.float64)


def surface_track(recording: Any) -> SurfaceTrack:
    """Return the surface of a recording.

    Raises:
        RecordingError: The recording holds no organised cloud named `nodes`.
    """
    for topic, channel in recording.channels.items():
        if _ends(topic, "nodes") and channel.type == CLOUD and len(channel.messages):
            return SurfaceTrack(channel, recording.start)
    raise RecordingError(
        f"the bag holds no topic 'nodes' of type {CLOUD}, only {sorted(recording.channels)}; "
        "record the twin's nodes topic to draw its surface"
    )


def point_tracks(recording: Any, *, truth: bool) -> dict[str, Track]:
    """Return positions [m], shape (n, 3), by point: true ones (`truth/<name>/pose`) or the tracker's."""
    tracks = {}
    for topic, channel in _longest_first(recording):
        parts = topic.strip("/").split("/")
        is_truth = len(parts) >= 3 and parts[-3] == "truth"
        if (
            channel.type != POSE
            or parts[-1] != "pose"
            or len(parts) < 2
            or is_truth != truth
            or not len(channel.messages)
        ):
            continue
        messages = list(channel.messages)
        place = np.array([[m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in messages])
        tracks[parts[-2]] = Track(_stamps(messages, recording.start), place)
    return tracks


def joint_tracks(recording: Any) -> tuple[tuple[str, ...], Track, Track] | None:
    """Return joint names, angles [rad], torques [N m], shape (n, n_joints) each; None without arms."""
    for topic, channel in recording.channels.items():
        if _ends(topic, "joint_states") and channel.type == JOINTS and len(channel.messages):
            messages = list(channel.messages)
            time = _stamps(messages, recording.start)
            angle = np.array([m.position for m in messages])
            torque = np.array([m.effort for m in messages])
            return tuple(messages[0].name), Track(time, angle), Track(time, torque)
    return None


def pressure_tracks(recording: Any) -> dict[str, Track]:
    """Return the measured absolute pressures [Pa], shape (n,), by arm name."""
    tracks = {}
    for topic, channel in _longest_first(recording):
        if _ends(topic, "pressure") and channel.type == PRESSURE and len(channel.messages):
            messages = list(channel.messages)
            value = np.array([m.fluid_pressure for m in messages])
            tracks[topic.strip("/").split("/")[-2]] = Track(_stamps(messages, recording.start), value)
    return tracks


def seconds(nanoseconds: np.ndarray, start: int) -> np.ndarray:
    """Return times [s] of nanosecond stamps: simulation times as they are, wall times from `start` on."""
    origin = start if len(nanoseconds) and nanoseconds[0] > _WALL_CLOCK else 0
    return np.asarray(nanoseconds - origin, dtype=np.int64) * 1e-9


def _stamps(messages: Sequence[Any], start: int) -> np.ndarray:
    # The header says when the value was true; the log time says when it was sent, a delay later.
    stamps = np.array(
        [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages], dtype=np.int64
    )
    return seconds(stamps, start)


def _longest_first(recording: Any) -> list[tuple[str, Any]]:
    # A bridge reports its rig under `rig/P0/pose` beside the twin's own `P0/pose`: the shorter name, read last, stays.
    return sorted(recording.channels.items(), key=lambda item: (-item[0].count("/"), item[0]))


def _ends(topic: str, name: str) -> bool:
    return topic.strip("/").split("/")[-1] == name

"""Tracks and snapshots: the topics of a Recording as arrays over time, and each recorded surface with its loads.

Times are in seconds, values in ldcs_base and SI units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.bags import Channel, Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.markers import DrawableState
from ldcs_ros.messages.message_types import PointCloudMessage, StampedMessage, WrenchStampedMessage
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.topics import find_topic, find_topics

CLOUD = "sensor_msgs/msg/PointCloud2"
POSE = "geometry_msgs/msg/PoseStamped"
JOINTS = "sensor_msgs/msg/JointState"
PRESSURE = "sensor_msgs/msg/FluidPressure"
WRENCH = "geometry_msgs/msg/WrenchStamped"

# A stamp beyond this is of a wall clock, not of a simulation: times then count from the recording's start.
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
    """The recorded surface over time; a cloud is unpacked on demand.

    Attributes:
        time: Times of the clouds [s], shape (n,).
        nodes: Nodes along x and y.
    """

    def __init__(self, channel: Channel, start: int) -> None:
        self._messages: Sequence[PointCloudMessage] = channel.messages
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


def cloud_positions(cloud: PointCloudMessage) -> np.ndarray:
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


def surface_track(recording: Recording) -> SurfaceTrack:
    """Return the surface of a recording.

    Raises:
        RecordingError: The recording holds no organised cloud named `nodes`.
    """
    return SurfaceTrack(recording.channels[surface_topic(recording)], recording.start)


def surface_topic(recording: Recording) -> str:
    """Return the topic of the surface.

    Raises:
        RecordingError: The recording holds no organised cloud named `nodes`.
    """
    topic = find_topic(recording, "nodes", CLOUD)
    if topic is None:
        raise RecordingError(
            f"{recording.name} holds no topic 'nodes' of type {CLOUD}, only {sorted(recording.topics)}; "
            "record the twin's topic 'nodes' to see its surface"
        )
    return topic


def point_tracks(recording: Recording, *, truth: bool) -> dict[str, Track]:
    """Return positions [m], shape (n, 3), by point: true ones (`truth/<name>/pose`) or the tracker's."""
    tracks: dict[str, Track] = {}
    for topic in find_topics(recording, "pose", POSE):
        parts = topic.strip("/").split("/")
        is_truth = len(parts) >= 3 and parts[-3] == "truth"
        if len(parts) < 2 or is_truth != truth or parts[-2] in tracks:
            continue
        messages = list(recording.channels[topic].messages)
        place = np.array([[m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in messages])
        tracks[parts[-2]] = Track(_stamps(messages, recording.start), place)
    return tracks


def joint_tracks(recording: Recording) -> tuple[tuple[str, ...], Track, Track] | None:
    """Return joint names, angles [rad], torques [N m], shape (n, n_joints) each; None without arms."""
    topic = find_topic(recording, "joint_states", JOINTS)
    if topic is None:
        return None
    messages = list(recording.channels[topic].messages)
    time = _stamps(messages, recording.start)
    angle = np.array([m.position for m in messages])
    torque = np.array([m.effort for m in messages])
    return tuple(messages[0].name), Track(time, angle), Track(time, torque)


def pressure_tracks(recording: Recording) -> dict[str, Track]:
    """Return the measured absolute pressures [Pa], shape (n,), by arm name."""
    tracks: dict[str, Track] = {}
    for topic in find_topics(recording, "pressure", PRESSURE):
        parts = topic.strip("/").split("/")
        if len(parts) > 1 and parts[-2] not in tracks:
            messages = list(recording.channels[topic].messages)
            value = np.array([m.fluid_pressure for m in messages])
            tracks[parts[-2]] = Track(_stamps(messages, recording.start), value)
    return tracks


def seconds(nanoseconds: np.ndarray, start: int) -> np.ndarray:
    """Return times [s] of nanosecond stamps: simulation times unchanged, wall times from `start` on."""
    origin = start if len(nanoseconds) and nanoseconds[0] > _WALL_CLOCK else 0
    return np.asarray(nanoseconds - origin, dtype=np.int64) * 1e-9


def _stamps(messages: Sequence[StampedMessage], start: int) -> np.ndarray:
    # The stamp of the header is the time of the value; the log time is that of sending, a delay later.
    stamps = np.array(
        [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages], dtype=np.int64
    )
    return seconds(stamps, start)


@dataclass(frozen=True)
class Snapshot:
    """One recorded surface with its arms and loads.

    Attributes:
        time: Log time [ns].
        nodes: Nodes along x and y.
        shown: The sheet, the arms and the commanded wrenches.
    """

    time: int
    nodes: tuple[int, int]
    shown: DrawableState


def snapshots(recording: Recording, scene: Scene | None, *, every: int = 1) -> Iterator[Snapshot]:
    """Return the snapshots of a bag in their order.

    Args:
        recording: A Recording.
        scene: Its scene, or None: then there are neither arms nor wrenches.
        every: Take every n-th surface.

    Raises:
        RecordingError: The bag holds no surface.
    """
    clouds = surface_topic(recording)
    joints, wrench = (
        find_topic(recording, "joint_states", JOINTS),
        find_topic(recording, "external_wrench", WRENCH),
    )
    state = _LatestLoads(scene)
    waiting: Snapshot | None = None
    count = 0
    for message in recording.in_order([topic for topic in (clouds, joints, wrench) if topic is not None]):
        # Arms and loads of a surface are recorded after it with the same time.
        if waiting is not None and message.time > waiting.time:
            yield state.complete(waiting)
            waiting = None
        if message.topic == clouds:
            if count % every == 0:
                cloud = recording.decode(message)
                waiting = Snapshot(
                    message.time, (cloud.height // 2, cloud.width), DrawableState(cloud_positions(cloud))
                )
            count += 1
        elif message.topic == joints:
            state.joints = np.asarray(recording.decode(message).position, dtype=float)
        else:
            state.take_wrench(message.time, recording.decode(message))
    if waiting is not None:
        yield state.complete(waiting)


class _LatestLoads:
    """The latest joint angles and wrenches of a bag."""

    def __init__(self, scene: Scene | None) -> None:
        self._links = 0 if scene is None or scene.effect("arms") is None else scene.effect("arms").links
        self._takes_wrenches = scene is not None and scene.effect("wrench") is not None
        self._schedule = () if scene is None else scene.inputs
        self._next = 0
        self._wrenches: dict[str, Wrench] = {}
        self.joints = np.zeros(0)

    def take_wrench(self, time: int, message: WrenchStampedMessage) -> None:
        self._follow_schedule(time)
        force, torque = message.wrench.force, message.wrench.torque
        # Several twins in one tf tree have a prefix before each frame.
        frame = message.header.frame_id.split("/")[-1]
        self._wrenches[frame] = Wrench((force.x, force.y, force.z), (torque.x, torque.y, torque.z))

    def complete(self, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot with arms and wrenches, also those that the scene's schedule commands."""
        self._follow_schedule(snapshot.time)
        angles = np.zeros((0, 0))
        if self._links and self.joints.size and self.joints.size % self._links == 0:
            angles = np.cumsum(self.joints.reshape(-1, self._links), axis=1)
        wrenches = dict(self._wrenches) if self._takes_wrenches else {}
        shown = DrawableState(snapshot.shown.position, angles, wrenches)
        return Snapshot(snapshot.time, snapshot.nodes, shown)

    def _follow_schedule(self, time: int) -> None:
        while self._next < len(self._schedule) and 1e9 * self._schedule[self._next].time <= time:
            if (scheduled := self._schedule[self._next].wrench) is not None:
                frame, force, torque = scheduled
                self._wrenches[frame] = Wrench(force, torque)
            self._next += 1

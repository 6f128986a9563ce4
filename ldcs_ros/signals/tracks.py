"""Tracks and snapshots: the topics of a Recording as arrays over time, and each recorded surface with its loads.

Times are in seconds, values in ldcs_base and SI units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.bags import Channel, Recording
from ldcs_ros.errors import RecordingError, one_line
from ldcs_ros.messages.display.markers import DrawableState
from ldcs_ros.messages.message_types import PointCloudMessage, StampedMessage, WrenchStampedMessage
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.topics import find_topic, find_topics
from ldcs_ros.twin.settings import RunSettings

CLOUD = "sensor_msgs/msg/PointCloud2"
POSE = "geometry_msgs/msg/PoseStamped"
JOINTS = "sensor_msgs/msg/JointState"
PRESSURE = "sensor_msgs/msg/FluidPressure"
WRENCH = "geometry_msgs/msg/WrenchStamped"

WALL_CLOCK = 10 * 365 * 86_400 * 1_000_000_000
"""A time beyond this is of a wall clock, not of a simulation [ns]: times then count from the recording's start."""


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
        """The first value, shape (k,)."""
        value: np.ndarray = self.value[0]
        return value

    @property
    def last(self) -> np.ndarray:
        """The last value, shape (k,)."""
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
        self.nodes: tuple[int, int] = cloud_nodes(self._messages[0])
        self.time = seconds(np.asarray(channel.times), start)

    def __len__(self) -> int:
        return len(self.time)

    def index(self, time: float) -> int:
        """Return the index of the cloud nearest to a time [s]."""
        return int(np.argmin(np.abs(self.time - time)))

    def position(self, index: int) -> np.ndarray:
        """Return node positions of one cloud [m], shape (2, nx, ny, 3): layer (bottom, top), i, j.

        Raises:
            RecordingError: The cloud has another size than the first one.
        """
        cloud = self._messages[index]
        if cloud_nodes(cloud) != self.nodes:
            raise RecordingError(
                f"the clouds of a recording differ in size: {cloud_nodes(cloud)} nodes after {self.nodes}"
            )
        return cloud_positions(cloud).reshape(2, *self.nodes, 3)


LARGEST_POSITION = 1.0e6
"""Coordinates from this on are none [m]."""
_NUMBERS = {7: "f4", 8: "f8"}
"""Datatype of a PointField -> NumPy."""


def cloud_nodes(cloud: PointCloudMessage) -> tuple[int, int]:
    """Return the nodes along x and y of a cloud of the sheet: the rows of the bottom layer, then those of the top.

    Raises:
        RecordingError: It is not organised in this way.
    """
    if cloud.height < 4 or cloud.height % 2 or cloud.width < 2:
        raise RecordingError(
            f"a cloud on the topic 'nodes' has {cloud.height} rows of {cloud.width} points, "
            "expected both layers of a sheet: an even number of rows from 4 on, two points or more in each"
        )
    return cloud.height // 2, cloud.width


def cloud_positions(cloud: PointCloudMessage) -> np.ndarray:
    """Return x, y, z of every point of a PointCloud2 [m], shape (n, 3), as float64; NaN where none was measured.

    Raises:
        RecordingError: It has no x, y, z as float32 or float64, or fewer bytes than it claims.
    """
    fields = {field.name: field for field in cloud.fields}
    if not all(axis in fields and fields[axis].datatype in _NUMBERS for axis in "xyz"):
        raise RecordingError(
            f"a cloud has the fields {sorted(fields)[:10]}, expected x, y, z as float32 or float64"
        )
    order = ">" if cloud.is_bigendian else "<"
    formats = [np.dtype(order + _NUMBERS[fields[axis].datatype]) for axis in "xyz"]
    ends = [fields[axis].offset + number.itemsize for axis, number in zip("xyz", formats, strict=True)]
    row = cloud.row_step or cloud.width * cloud.point_step
    size = max(0, cloud.height - 1) * row + cloud.width * cloud.point_step
    if max(ends) > cloud.point_step or row < cloud.width * cloud.point_step or size > len(cloud.data):
        raise RecordingError(
            f"a cloud of {cloud.height} x {cloud.width} points of {cloud.point_step} bytes, "
            f"{row} bytes a row, does not fit into its {len(cloud.data)} bytes"
        )
    data = bytes(cloud.data)
    points = [
        np.ndarray(
            (cloud.height, cloud.width),
            dtype=number,
            buffer=data,
            offset=fields[axis].offset,
            strides=(row, cloud.point_step),
        )
        for axis, number in zip("xyz", formats, strict=True)
    ]
    found = np.stack(points, axis=-1).reshape(-1, 3).astype(np.float64)
    found[~(np.abs(found) < LARGEST_POSITION).all(axis=1)] = np.nan
    if not np.isfinite(found).any():
        raise RecordingError("a cloud on the topic 'nodes' holds no position")
    return found


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
        tracks[parts[-2]] = Track(_stamps(recording, topic, messages), place)
    return tracks


def joint_tracks(recording: Recording) -> tuple[tuple[str, ...], Track, Track] | None:
    """Return joint names, angles [rad], torques [N m], shape (n, n_joints) each; None without arms."""
    topic = find_topic(recording, "joint_states", JOINTS)
    if topic is None:
        return None
    messages = list(recording.channels[topic].messages)
    time = _stamps(recording, topic, messages)
    angle = np.array([m.position for m in messages])
    torque = np.array([m.effort for m in messages])
    return tuple(messages[0].name), Track(time, angle), Track(time, torque)


def pressure_tracks(recording: Recording) -> dict[str, Track]:
    """Return the measured gauge pressures [Pa], shape (n,), by arm name.

    FluidPressure is absolute by its definition; a bag names the pressure of its surrounding air.

    Raises:
        RecordingError: The run settings of the bag are invalid.
    """
    try:
        ambient = RunSettings.from_metadata(recording.custom_data).ambient_pressure
    except ValueError as error:
        raise RecordingError(f"{recording.name} has settings that are none: {one_line(error)}") from error
    tracks: dict[str, Track] = {}
    for topic in find_topics(recording, "pressure", PRESSURE):
        parts = topic.strip("/").split("/")
        if len(parts) > 1 and parts[-2] not in tracks:
            messages = list(recording.channels[topic].messages)
            value = np.array([m.fluid_pressure for m in messages]) - ambient
            tracks[parts[-2]] = Track(_stamps(recording, topic, messages), value)
    return tracks


def check_one_clock(recording: Recording) -> None:
    """Refuse a recording that begins on a simulation's clock, or on none, and ends on a wall clock.

    Raises:
        RecordingError: Its recorder's clock was set meanwhile, so that its times are of no use.
    """
    if recording.start < WALL_CLOCK <= recording.end:
        raise RecordingError(
            f"{recording.name} has log times from {recording.start * 1e-9:.3f} s to {recording.end * 1e-9:.3f} s "
            "after 1970: the clock of its recorder was set; leave out what was recorded before"
        )


def seconds(nanoseconds: np.ndarray, start: int) -> np.ndarray:
    """Return times [s], shape (n,), of nanosecond stamps: simulation times unchanged, wall times from `start` on."""
    origin = start if len(nanoseconds) and nanoseconds[0] > WALL_CLOCK else 0
    return np.asarray(nanoseconds - origin, dtype=np.int64) * 1e-9


def _stamps(recording: Recording, topic: str, messages: Sequence[StampedMessage]) -> np.ndarray:
    # The stamp of the header is the time of the value; the log time is that of sending, a delay later.
    stamps = np.array(
        [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages], dtype=np.int64
    )
    # An unset stamp of a wall clock is none.
    logs = recording.channels[topic].times
    return seconds(np.where((stamps == 0) & (logs > WALL_CLOCK), logs, stamps), recording.start)


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
                waiting = Snapshot(message.time, cloud_nodes(cloud), DrawableState(cloud_positions(cloud)))
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

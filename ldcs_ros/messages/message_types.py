"""The fields of message objects that this package reads; the type store makes their classes at run time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol


class RosMessage(Protocol):
    """A message object of the type store."""

    __msgtype__: str


MessageClass = Callable[..., RosMessage]
"""The class of a message: its arguments are the fields of the definition, by name."""


class TimeMessage(Protocol):
    """A Time or a Duration."""

    sec: int
    nanosec: int


class HeaderMessage(RosMessage, Protocol):
    """A std_msgs/Header."""

    stamp: TimeMessage
    frame_id: str


class VectorMessage(Protocol):
    """A Vector3 or a Point."""

    x: float
    y: float
    z: float


class QuaternionMessage(VectorMessage, Protocol):
    """A geometry_msgs/Quaternion."""

    w: float


class PoseMessage(Protocol):
    """A geometry_msgs/Pose."""

    position: VectorMessage
    orientation: QuaternionMessage


class WrenchMessage(Protocol):
    """A geometry_msgs/Wrench."""

    force: VectorMessage
    torque: VectorMessage


class StampedMessage(RosMessage, Protocol):
    """Any message with a header."""

    header: HeaderMessage


class WrenchStampedMessage(StampedMessage, Protocol):
    """A geometry_msgs/WrenchStamped."""

    wrench: WrenchMessage


class ArrayMessage(RosMessage, Protocol):
    """A std_msgs/Float64MultiArray."""

    data: Sequence[float]


class JointStateMessage(RosMessage, Protocol):
    """A sensor_msgs/JointState, as far as a command has it."""

    name: Sequence[str]
    effort: Sequence[float]


class PointFieldMessage(Protocol):
    """A sensor_msgs/PointField, as far as a surface needs it."""

    name: str
    offset: int
    datatype: int


class PointCloudMessage(StampedMessage, Protocol):
    """A sensor_msgs/PointCloud2."""

    height: int
    width: int
    fields: Sequence[PointFieldMessage]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: bytes


class ColourMessage(Protocol):
    """A std_msgs/ColorRGBA."""

    r: float
    g: float
    b: float
    a: float


class MarkerMessage(RosMessage, Protocol):
    """A visualization_msgs/Marker."""

    header: HeaderMessage
    ns: str
    type: int
    action: int
    pose: PoseMessage
    scale: VectorMessage
    color: ColourMessage
    points: Sequence[VectorMessage]
    text: str


class MarkerArrayMessage(RosMessage, Protocol):
    """A visualization_msgs/MarkerArray."""

    markers: Sequence[MarkerMessage]

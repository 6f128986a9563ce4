"""A rig on ROS topics, by a mapping: rules of its topics; messages are bytes here, a node carries them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ldcs_ros.errors import BridgeError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.display.loads import rotate
from ldcs_ros.messages.message_types import VectorMessage
from ldcs_ros.rig.link import Link, RawPacket
from ldcs_ros.rig.reading import RawReading
from ldcs_ros.rig.units import PressureUnit

POSITION_TYPES = ("geometry_msgs/msg/TransformStamped", "geometry_msgs/msg/PoseStamped")
PRESSURE_TYPES = (
    "std_msgs/msg/Float64MultiArray",
    "sensor_msgs/msg/FluidPressure",
    "sensor_msgs/msg/JointState",
)
JOINT_FIELDS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class Incoming:
    """The rule of one topic of the rig.

    Attributes:
        topic: Its name.
        type: Its message type.
        gives: 'pressure', 'pressure_command' or 'position'.
        names: Arm or point by the message's own name: child frame, frame, joint, or index as text.
        unit: Unit of pressures.
        field: Field of a JointState that holds the pressures.
        age: Age of a value at its stamp [s].
        origin: Position of the tracker's base in ldcs_base [m].
        turn: Its orientation there, quaternion x, y, z, w.
    """

    topic: str
    type: str
    gives: str
    names: Mapping[str, str]
    unit: PressureUnit = PressureUnit()
    field: str = "effort"
    age: float = 0.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        types = POSITION_TYPES if self.gives == "position" else PRESSURE_TYPES
        if self.type not in types:
            raise BridgeError(
                f"{self.topic} gives {self.gives}: got {self.type!r}, expected one of {list(types)}"
            )


@dataclass(frozen=True)
class Outgoing:
    """The topic of set-points: a Float64MultiArray with one value an arm in the order of the rig file.

    Attributes:
        topic: Its name.
        unit: Unit of the pressures.
    """

    topic: str
    unit: PressureUnit = field(default_factory=PressureUnit)


@dataclass(frozen=True)
class TopicSettings:
    """The topics of a rig: rules of incoming topics, the topic of set-points, and its rate [Hz]."""

    receive: tuple[Incoming, ...]
    send: Outgoing | None
    rate: float = 50.0


class TopicLink(Link):
    """A listener: takes messages as bytes from the node that subscribes for it.

    Args:
        incoming: Rules of the topics that come in.
        clock: Steady clock [s].
    """

    def __init__(self, incoming: tuple[Incoming, ...], clock: Callable[[], float]) -> None:
        super().__init__("topics", clock)
        self.incoming = {one.topic: one for one in incoming}
        # DDS connects by itself, and silence is noticed as such.
        self.connected, self.error = True, ""

    def receive(self, topic: str, cdr: bytes, heard: float | None = None) -> None:
        """Take a message's bytes, heard at a steady time [s] or now; invalid bytes are counted."""
        rule = self.incoming[topic]
        heard = self.clock() if heard is None else heard
        self._packets.append(RawPacket(topic, False, cdr, heard, rule.type))
        try:
            message = decode(rule.type, cdr)
            found = values_of(rule, message)
        except Exception:  # foreign bytes: the decoder fails in as many ways as there are bytes
            self.malformed += 1
            return
        header = getattr(message, "header", None)
        stamp = None if header is None else header.stamp.sec + header.stamp.nanosec * 1e-9
        for name, value in found:
            self._readings.append(RawReading(rule.gives, name, value, heard, topic, stamp or None, rule.age))


def values_of(
    rule: Incoming,
    message: Any,  # of one of POSITION_TYPES or PRESSURE_TYPES, of the type store or of rclpy
) -> list[tuple[str, np.ndarray]]:
    """Return names with gauge pressures [Pa], shape (), or positions in ldcs_base [m], shape (3,), of a message."""
    kind = rule.type.rsplit("/", 1)[1]
    if kind == "TransformStamped":
        name = rule.names.get(message.child_frame_id)
        return [] if name is None else [(name, _placed(rule, message.transform.translation))]
    if kind == "PoseStamped":
        name = rule.names.get("0")
        return [] if name is None else [(name, _placed(rule, message.pose.position))]
    if kind == "FluidPressure":
        numbers = {"0": message.fluid_pressure, message.header.frame_id: message.fluid_pressure}
    elif kind == "JointState":
        numbers = dict(zip(message.name, getattr(message, rule.field), strict=False))
    else:
        numbers = {str(index): value for index, value in enumerate(message.data)}
        if len(numbers) < len(rule.names):
            raise ValueError(f"got {len(numbers)} numbers, expected {len(rule.names)}")
    return [
        (name, np.array(rule.unit.to_pascal(float(numbers[key]))))
        for key, name in rule.names.items()
        if key in numbers
    ]


def _placed(rule: Incoming, place: VectorMessage) -> np.ndarray:
    return np.array(rule.origin) + rotate(np.array(rule.turn), (place.x, place.y, place.z))

"""One visualization marker: kinds, actions, and how it is filled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.messages.display.colours import Colour
from ldcs_ros.messages.message_types import MarkerArrayMessage, RosMessage

ARROW, SPHERE, CYLINDER, LINE_STRIP, SPHERE_LIST, TEXT, TRIANGLE_LIST = 0, 2, 3, 4, 7, 9, 11
ADD, DELETE_ALL = 0, 3


@dataclass(frozen=True)
class MarkerSpec:
    """The content of a marker, apart from header, number and action.

    Attributes:
        namespace: Group that viewers list it under.
        kind: ARROW, SPHERE, LINE_STRIP and so on.
        scale: Sizes [m]; their meaning depends on the kind.
        colour: Red, green, blue, opacity, 0 ... 1.
        position: Position of its origin [m], shape (3,).
        orientation: Unit quaternion x, y, z, w; a cylinder lies along its own z.
        points: Points of the kinds that have some [m], shape (n, 3).
        text: Content of a text.
    """

    namespace: str
    kind: int
    scale: tuple[float, float, float]
    colour: Colour
    position: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    points: Sequence[Sequence[float] | np.ndarray] | np.ndarray = ()
    text: str = ""


_NOTHING = MarkerSpec("", ARROW, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def marker(
    head: RosMessage,
    spec: MarkerSpec,
    *,
    number: int = 0,
    colours: Iterable[RosMessage] = (),
    action: int = ADD,
) -> RosMessage:
    """Return a visualization_msgs/Marker.

    Args:
        head: Its std_msgs/Header.
        spec: Its content.
        number: Its number in its namespace.
        colours: std_msgs/ColorRGBA of each point; none for the figure's own.
        action: Add, or delete what was there.
    """
    nothing = np.zeros(0, dtype=np.uint8)
    x, y, z = spec.scale
    turn = dict(zip("xyzw", spec.orientation, strict=True))
    return message_class("visualization_msgs/msg/Marker")(
        header=head,
        ns=spec.namespace,
        id=number,
        type=spec.kind,
        action=action,
        pose=message_class("geometry_msgs/msg/Pose")(
            position=point(spec.position),
            orientation=message_class("geometry_msgs/msg/Quaternion")(**turn),
        ),
        scale=message_class("geometry_msgs/msg/Vector3")(x=x, y=y, z=z),
        color=rgba(spec.colour),
        lifetime=message_class("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        points=[point(one) for one in spec.points],
        colors=list(colours),
        texture_resource="",
        texture=message_class("sensor_msgs/msg/CompressedImage")(header=head, format="", data=nothing),
        uv_coordinates=[],
        text=spec.text,
        mesh_resource="",
        mesh_file=message_class("visualization_msgs/msg/MeshFile")(filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def marker_array(time_ns: int, frame: str, specs: Iterable[MarkerSpec]) -> bytes:
    """Return a MarkerArray that replaces what its topic showed before.

    Args:
        time_ns: Its stamp [ns].
        frame: Frame that all are in.
        specs: Its markers.
    """
    head = header(time_ns, frame)
    clear = marker(head, _NOTHING, action=DELETE_ALL)
    shown = [marker(head, spec, number=number) for number, spec in enumerate(specs)]
    return encode(message_class("visualization_msgs/msg/MarkerArray")(markers=[clear, *shown]))


def specs_of(message: MarkerArrayMessage) -> list[MarkerSpec]:
    """Return what a MarkerArray adds; the opposite of `marker_array`."""
    return [
        MarkerSpec(
            one.ns,
            one.type,
            (one.scale.x, one.scale.y, one.scale.z),
            (one.color.r, one.color.g, one.color.b, one.color.a),
            (one.pose.position.x, one.pose.position.y, one.pose.position.z),
            (
                one.pose.orientation.x,
                one.pose.orientation.y,
                one.pose.orientation.z,
                one.pose.orientation.w,
            ),
            [(place.x, place.y, place.z) for place in one.points],
            one.text,
        )
        for one in message.markers
        if one.action == ADD
    ]


def point(place: Iterable[float]) -> RosMessage:
    """Return a geometry_msgs/Point [m]."""
    x, y, z = (float(value) for value in place)
    return message_class("geometry_msgs/msg/Point")(x=x, y=y, z=z)


def rgba(colour: Iterable[float]) -> RosMessage:
    """Return a std_msgs/ColorRGBA; each from 0 to 1."""
    r, g, b, a = (float(value) for value in colour)
    return message_class("std_msgs/msg/ColorRGBA")(r=r, g=g, b=b, a=a)

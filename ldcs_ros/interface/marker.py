"""One visualization marker: kinds, actions, and how it is filled."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ldcs_ros.interface.cdr import encode, header, message_class

ARROW, SPHERE, LINE_STRIP, SPHERE_LIST, TEXT, TRIANGLE_LIST = 0, 2, 4, 7, 9, 11
ADD, DELETE_ALL = 0, 3

Colour = tuple[float, float, float, float]
_IDENTITY = (0.0, 0.0, 0.0, 1.0)
_NO_COLOUR: Colour = (0.0, 0.0, 0.0, 0.0)


def marker(
    head: Any,
    *,
    namespace: str,
    number: int,
    kind: int,
    scale: tuple[float, float, float],
    colour: Colour,
    position: Iterable[float] = (0.0, 0.0, 0.0),
    points: Iterable[Iterable[float]] = (),
    colours: list[Any] | None = None,
    text: str = "",
    action: int = ADD,
) -> Any:
    """Return a visualization_msgs/Marker that is not turned.

    Args:
        head: Its std_msgs/Header.
        namespace: Group that viewers list it under.
        number: Its number in that group.
        kind: What is drawn.
        scale: Sizes [m]; what they mean depends on the kind.
        colour: Red, green, blue, opacity.
        position: Where its own origin is [m].
        points: Points of the kinds that have some [m], shape (n, 3).
        colours: std_msgs/ColorRGBA of each point; None for the marker's own.
        text: What a text says.
        action: Add, or delete what was there.
    """
    x, y, z, w = _IDENTITY
    pose = message_class("geometry_msgs/msg/Pose")(
        position=point(position),
        orientation=message_class("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w),
    )
    nothing = np.zeros(0, dtype=np.uint8)
    return message_class("visualization_msgs/msg/Marker")(
        header=head,
        ns=namespace,
        id=number,
        type=kind,
        action=action,
        pose=pose,
        scale=message_class("geometry_msgs/msg/Vector3")(x=scale[0], y=scale[1], z=scale[2]),
        color=rgba(colour),
        lifetime=message_class("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        points=[point(one) for one in points],
        colors=colours or [],
        texture_resource="",
        texture=message_class("sensor_msgs/msg/CompressedImage")(header=head, format="", data=nothing),
        uv_coordinates=[],
        text=text,
        mesh_resource="",
        mesh_file=message_class("visualization_msgs/msg/MeshFile")(filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def marker_array(time_ns: int, frame: str, markers: Iterable[dict[str, Any]]) -> bytes:
    """Return a MarkerArray that replaces what its topic showed before.

    Args:
        time_ns: Its stamp [ns].
        frame: Frame that all are in.
        markers: Arguments of `marker` for each one, without header and number.
    """
    head = header(time_ns, frame)
    clear = marker(
        head,
        namespace="",
        number=0,
        kind=ARROW,
        scale=(0.0, 0.0, 0.0),
        colour=_NO_COLOUR,
        action=DELETE_ALL,
    )
    shown = [marker(head, number=number, **one) for number, one in enumerate(markers)]
    return encode(message_class("visualization_msgs/msg/MarkerArray")(markers=[clear, *shown]))


def point(place: Iterable[float]) -> Any:
    """Return a geometry_msgs/Point [m]."""
    x, y, z = (float(value) for value in place)
    return message_class("geometry_msgs/msg/Point")(x=x, y=y, z=z)


def rgba(colour: Iterable[float]) -> Any:
    """Return a std_msgs/ColorRGBA; each from 0 to 1."""
    r, g, b, a = (float(value) for value in colour)
    return message_class("std_msgs/msg/ColorRGBA")(r=r, g=g, b=b, a=a)

"""The forces on the sheet as arrows for viewers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.interface.cdr import encode, header, message_class
from ldcs_ros.interface.surface import marker
from ldcs_ros.interface.topics import BASE_FRAME

_ARROW = 0
_ADD, _DELETE_ALL = 0, 3
_METRES_A_NEWTON = 0.1
_SHAFT, _HEAD, _HEAD_LENGTH = 0.002, 0.005, 0.008
_COLOUR = (0.80, 0.15, 0.15, 1.0)


@dataclass(frozen=True)
class Load:
    """A force on the sheet.

    Attributes:
        name: What it is, for viewers that list markers.
        position: Where it acts in ldcs_base [m], shape (3,).
        force: Force in ldcs_base [N], shape (3,).
    """

    name: str
    position: np.ndarray
    force: np.ndarray


def load_arrows(time_ns: int, loads: Iterable[Load]) -> bytes:
    """Return `loads`: a MarkerArray that replaces what was shown; an arrow of 0.1 m for each newton."""
    head = header(time_ns, BASE_FRAME)
    size = (_SHAFT, _HEAD, _HEAD_LENGTH)
    arrows = [
        marker(
            head,
            namespace="",
            number=0,
            kind=_ARROW,
            scale=size,
            colour=_COLOUR,
            points=[],
            action=_DELETE_ALL,
        )
    ]
    point = message_class("geometry_msgs/msg/Point")
    for number, load in enumerate(loads):
        ends = (load.position, load.position + _METRES_A_NEWTON * load.force)
        points = [point(x=float(x), y=float(y), z=float(z)) for x, y, z in ends]
        arrows.append(
            marker(
                head,
                namespace=load.name,
                number=number,
                kind=_ARROW,
                scale=size,
                colour=_COLOUR,
                points=points,
                action=_ADD,
            )
        )
    return encode(message_class("visualization_msgs/msg/MarkerArray")(markers=arrows))


def rotate(quaternion: np.ndarray, vector: Iterable[float]) -> np.ndarray:
    """Return a vector turned by a unit quaternion x, y, z, w, shape (3,)."""
    axis, scalar = np.asarray(quaternion[:3], dtype=float), float(quaternion[3])
    vector = np.asarray(tuple(vector), dtype=float)
    across = np.cross(axis, vector)
    return vector + 2.0 * (scalar * across + np.cross(axis, across))

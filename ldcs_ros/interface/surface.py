"""The whole sheet as messages: the cloud of nodes, and a triangle mesh for viewers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.interface.cdr import PatchedMessage, header, message_class, sentinel
from ldcs_ros.interface.topics import BASE_FRAME

CLOUD_FIELDS = ("x", "y", "z", "vx", "vy", "vz")
_FLOAT32 = 7
_TRIANGLE_LIST = 11
_COLOUR = (0.93, 0.62, 0.42, 1.0)


class NodeCloud:
    """Builds `nodes`: an organised PointCloud2, rows layer by layer then along x, columns along y.

    Args:
        nodes: Number of nodes along x and along y.
    """

    def __init__(self, nodes: tuple[int, int]) -> None:
        nx, ny = nodes
        point_step = 4 * len(CLOUD_FIELDS)
        self._numbers = np.empty((2 * nx * ny, len(CLOUD_FIELDS)), dtype="<f4")
        point_field = message_class("sensor_msgs/msg/PointField")
        message = message_class("sensor_msgs/msg/PointCloud2")(
            header=header(0, BASE_FRAME),
            height=2 * nx,
            width=ny,
            fields=[
                point_field(name=name, offset=4 * place, datatype=_FLOAT32, count=1)
                for place, name in enumerate(CLOUD_FIELDS)
            ],
            is_bigendian=False,
            point_step=point_step,
            row_step=point_step * ny,
            data=sentinel(self._numbers.nbytes),
            is_dense=True,
        )
        self._message = PatchedMessage(message, self._numbers.nbytes)

    def build(self, time_ns: int, position: np.ndarray, velocity: np.ndarray) -> bytes:
        """Return the message for positions [m] and velocities [m/s] of shape (n_nodes, 3)."""
        self._numbers[:, :3] = position
        self._numbers[:, 3:] = velocity
        return self._message.fill(time_ns, self._numbers)


class SurfaceMesh:
    """Builds `surface`: a Marker of triangles over both layers and the four sides, seen from outside.

    Args:
        nodes: Number of nodes along x and along y.
    """

    def __init__(self, nodes: tuple[int, int]) -> None:
        self._corners = triangles(nodes).ravel()
        size = self._corners.size * 24
        self._message = PatchedMessage(_mesh_marker(self._corners.size, size), size)

    def build(self, time_ns: int, position: np.ndarray) -> bytes:
        """Return the message for positions [m] of shape (n_nodes, 3)."""
        return self._message.fill(time_ns, np.ascontiguousarray(position[self._corners], dtype="<f8"))


def triangles(nodes: tuple[int, int]) -> np.ndarray:
    """Return node indices of the closed mesh, shape (n_triangles, 3), anticlockwise seen from outside."""
    nx, ny = nodes
    index = np.arange(2 * nx * ny).reshape(2, nx, ny)
    bottom, top = index
    return np.concatenate(
        [
            _grid(top),
            _grid(bottom.T),
            _grid(np.stack([bottom[:, 0], top[:, 0]], axis=1)),
            _grid(np.stack([top[:, -1], bottom[:, -1]], axis=1)),
            _grid(np.stack([top[0], bottom[0]], axis=1)),
            _grid(np.stack([bottom[-1], top[-1]], axis=1)),
        ]
    )


def _grid(index: np.ndarray) -> np.ndarray:
    # Two triangles a cell; the normal is (first axis) x (second axis).
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)


def _mesh_marker(n_corners: int, size: int) -> Any:
    corners = sentinel(size).view("<f8").reshape(n_corners, 3)
    point = message_class("geometry_msgs/msg/Point")
    return marker(
        header(0, BASE_FRAME),
        namespace="surface",
        number=0,
        kind=_TRIANGLE_LIST,
        scale=(1.0, 1.0, 1.0),
        colour=_COLOUR,
        points=[point(x=x, y=y, z=z) for x, y, z in corners.tolist()],
    )


def marker(
    header: Any,
    *,
    namespace: str,
    number: int,
    kind: int,
    scale: tuple[float, float, float],
    colour: tuple[float, float, float, float],
    points: list[Any],
    action: int = 0,
) -> Any:
    """Return a visualization_msgs/Marker at the origin; scale [m], colour red, green, blue, opacity."""
    vector = message_class("geometry_msgs/msg/Vector3")
    pose = message_class("geometry_msgs/msg/Pose")(
        position=message_class("geometry_msgs/msg/Point")(x=0.0, y=0.0, z=0.0),
        orientation=message_class("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0),
    )
    red, green, blue, opacity = colour
    nothing = np.zeros(0, dtype=np.uint8)
    return message_class("visualization_msgs/msg/Marker")(
        header=header,
        ns=namespace,
        id=number,
        type=kind,
        action=action,
        pose=pose,
        scale=vector(x=scale[0], y=scale[1], z=scale[2]),
        color=message_class("std_msgs/msg/ColorRGBA")(r=red, g=green, b=blue, a=opacity),
        lifetime=message_class("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        points=points,
        colors=[],
        texture_resource="",
        texture=message_class("sensor_msgs/msg/CompressedImage")(header=header, format="", data=nothing),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=message_class("visualization_msgs/msg/MeshFile")(filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )

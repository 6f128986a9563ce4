"""The surface for viewers: a triangle mesh over both layers and the four sides, coloured by height."""

from __future__ import annotations

import numpy as np

from ldcs_ros.messages.cdr import MessageTemplate, header, placeholder
from ldcs_ros.messages.display.colours import of_height
from ldcs_ros.messages.display.marker import TRIANGLE_LIST, MarkerSpec, marker, rgba
from ldcs_ros.messages.message_types import RosMessage
from ldcs_ros.messages.topics import BASE_FRAME

_POINT_BYTES, _COLOUR_BYTES = 24, 16
_COLOUR = (0.16, 0.55, 0.55, 1.0)


class SurfaceMesh:
    """Builds `surface`: a Marker of triangles over both layers and the four sides, coloured by height.

    Args:
        nodes: Number of nodes along x and along y.
        length: Length of the sheet along x, half of which above and below is the scale of colours [m].
        frame: Name of the base frame.
    """

    def __init__(self, nodes: tuple[int, int], length: float, frame: str = BASE_FRAME) -> None:
        self._corners = triangles(nodes).ravel()
        self._length = length
        sizes = self._corners.size * _POINT_BYTES, self._corners.size * _COLOUR_BYTES
        self._message = MessageTemplate(_mesh_marker(self._corners.size, frame), *sizes)

    def build(self, time_ns: int, position: np.ndarray) -> bytes:
        """Return the message for positions [m] of shape (n_nodes, 3)."""
        colours = of_height(position[:, 2], self._length)
        corners = np.ascontiguousarray(position[self._corners], dtype="<f8")
        return self._message.fill(time_ns, corners, np.ascontiguousarray(colours[self._corners], dtype="<f4"))


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


def _mesh_marker(n_corners: int, frame: str) -> RosMessage:
    corners = placeholder(n_corners * _POINT_BYTES).view("<f8").reshape(n_corners, 3)
    colours = placeholder(n_corners * _COLOUR_BYTES).view("<f4").reshape(n_corners, 4)
    # Viewers that know no colours by corner take the figure's own.
    spec = MarkerSpec("surface", TRIANGLE_LIST, (1.0, 1.0, 1.0), _COLOUR, points=corners.tolist())
    return marker(header(0, frame), spec, colours=[rgba(colour) for colour in colours.tolist()])

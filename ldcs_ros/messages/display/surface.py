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
        missing: Nodes in holes.
    """

    def __init__(
        self,
        nodes: tuple[int, int],
        length: float,
        frame: str = BASE_FRAME,
        missing: np.ndarray | None = None,
    ) -> None:
        self._corners = triangles(nodes, missing).ravel()
        self._length = length
        sizes = self._corners.size * _POINT_BYTES, self._corners.size * _COLOUR_BYTES
        self._message = MessageTemplate(_mesh_marker(self._corners.size, frame), *sizes)

    def build(self, time_ns: int, position: np.ndarray) -> bytes:
        """Return the message for positions [m] of shape (n_nodes, 3)."""
        colours = of_height(position[:, 2], self._length)
        corners = np.ascontiguousarray(position[self._corners], dtype="<f8")
        return self._message.fill(time_ns, corners, np.ascontiguousarray(colours[self._corners], dtype="<f4"))


def triangles(nodes: tuple[int, int], missing: np.ndarray | None = None) -> np.ndarray:
    """Return node indices of the closed mesh, shape (n_triangles, 3), anticlockwise seen from outside.

    Args:
        nodes: Number of nodes along x and along y.
        missing: Nodes in holes; the cells around them are open, with walls.
    """
    nx, ny = nodes
    bottom, top = np.arange(2 * nx * ny).reshape(2, nx, ny)
    kept = np.ones((nx, ny), dtype=bool)
    if missing is not None:
        kept.ravel()[missing[missing < nx * ny]] = False
    # Corners of each cell, anticlockwise seen from above.
    first, second = slice(None, -1), slice(1, None)
    corners = ((first, first), (second, first), (second, second), (first, second))
    whole = np.logical_and.reduce([kept[corner] for corner in corners])
    low, high = (np.stack([layer[corner] for corner in corners], axis=-1) for layer in (bottom, top))
    quads = [high[whole], low[whole][:, ::-1]]
    padded = np.pad(whole, 1)
    # A side of a cell is a wall where the cell beyond it is none: y_min, x_max, y_max, x_min.
    for k, (i, j) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
        beyond = padded[1 + i : nx + i, 1 + j : ny + j]
        a, b, wall = k, (k + 1) % 4, whole & ~beyond
        quads.append(np.stack([low[wall, a], low[wall, b], high[wall, b], high[wall, a]], axis=-1))
    quad = np.concatenate(quads)
    return np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def _mesh_marker(n_corners: int, frame: str) -> RosMessage:
    corners = placeholder(n_corners * _POINT_BYTES).view("<f8").reshape(n_corners, 3)
    colours = placeholder(n_corners * _COLOUR_BYTES).view("<f4").reshape(n_corners, 4)
    # Viewers that know no colours by corner take the figure's own.
    spec = MarkerSpec("surface", TRIANGLE_LIST, (1.0, 1.0, 1.0), _COLOUR, points=corners.tolist())
    return marker(header(0, frame), spec, colours=[rgba(colour) for colour in colours.tolist()])

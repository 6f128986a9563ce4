"""The sheet as a mesh for a viewer that shades it: corners with a normal of each face's own."""

from __future__ import annotations

import numpy as np

from ldcs_ros.messages.display.colours import of_height
from ldcs_ros.messages.display.surface import triangles


class ShadedMesh:
    """Both layers and the four sides; a node has a corner for each of them, so that edges stay sharp.

    Args:
        nodes: Number of nodes along x and along y.

    Attributes:
        triangles: Corners of each triangle, anticlockwise seen from outside, shape (n_triangles, 3).
    """

    def __init__(self, nodes: tuple[int, int]) -> None:
        nx, ny = nodes
        by_node = triangles(nodes)
        cells = [(nx - 1) * (ny - 1)] * 2 + [nx - 1] * 2 + [ny - 1] * 2
        face = np.repeat(np.arange(6), 2 * np.array(cells))
        corner = face[:, None] * (2 * nx * ny) + by_node
        known, index = np.unique(corner, return_inverse=True)
        self._node = known % (2 * nx * ny)
        self.triangles = index.reshape(-1, 3).astype(np.uint32)

    def corners(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return places [m] and unit normals of the corners, shape (n_corners, 3) each, float32.

        Args:
            position: Node positions [m], shape (n_nodes, 3).
        """
        place = position[self._node].astype(np.float32)
        a, b, c = (place[self.triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        normal = np.zeros_like(place)
        for k in range(3):
            np.add.at(normal, self.triangles[:, k], across)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        return place, normal / np.maximum(size, 1e-20)

    def colours(self, position: np.ndarray, length: float) -> np.ndarray:
        """Return the colours of the corners by height, red, green, blue, opacity 0 ... 255, shape (n_corners, 4)."""
        by_node = of_height(position[:, 2], length)
        return np.uint8(np.round(255.0 * by_node[self._node]))

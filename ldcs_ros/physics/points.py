"""Named points of the sheet, their moving frames, and how a force or torque there acts on nodes."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ldcs_ros.physics.lattice import LAYERS, Lattice

NODE_NAME = re.compile(r"^node_(bottom|top)_(\d+)_(\d+)$")
POINT_LAYERS = (*LAYERS, "mid")
NAMED_PLACES = ("centre", "free_edge")


@dataclass(frozen=True)
class Point:
    """A point that moves with the sheet: a node, or the mean of a block (both layers, middle of an even row).

    Its frame rotates with the sheet. x is along the lattice's x direction there, z along the normal (tangent in x
    times tangent in y), and y completes it. On the flat sheet it is parallel to `ldcs_base`.

    Attributes:
        lattice: The lattice it belongs to.
        layers: Which layers it averages: (0,) bottom, (1,) top, (0, 1) mid.
        columns: Which i along x it averages: one, or the two in the middle of an even number.
        rows: Which j along y it averages, likewise.
    """

    lattice: Lattice
    layers: tuple[int, ...]
    columns: tuple[int, ...]
    rows: tuple[int, ...]

    def _block(self, columns: tuple[int, ...], rows: tuple[int, ...]) -> np.ndarray:
        return self.lattice.index[np.ix_(self.layers, columns, rows)].ravel()

    @cached_property
    def nodes(self) -> np.ndarray:
        """Indices of the nodes that it averages, shape (n,)."""
        return self._block(self.columns, self.rows)

    @cached_property
    def neighbours(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Indices of the nodes before and after along x, and along y; an edge itself replaces those beyond it."""
        nx, ny = self.lattice.nodes
        before, after = (max(self.columns[0] - 1, 0),), (min(self.columns[-1] + 1, nx - 1),)
        right, left = (max(self.rows[0] - 1, 0),), (min(self.rows[-1] + 1, ny - 1),)
        return (
            self._block(before, self.rows),
            self._block(after, self.rows),
            self._block(self.columns, right),
            self._block(self.columns, left),
        )

    @cached_property
    def patch(self) -> np.ndarray:
        """Nodes around the point that take up a torque: both layers, up to one cell away, shape (n,)."""
        columns = slice(max(self.columns[0] - 1, 0), self.columns[-1] + 2)
        rows = slice(max(self.rows[0] - 1, 0), self.rows[-1] + 2)
        return self.lattice.index[:, columns, rows].ravel()

    def position(self, position: np.ndarray) -> np.ndarray:
        """Return the position of the point [m], shape (3,), from node positions of shape (n_nodes, 3)."""
        return position[self.nodes].mean(axis=0)

    def frame(self, position: np.ndarray) -> np.ndarray:
        """Return the axes of its frame as columns, shape (3, 3), from node positions [m] of shape (n_nodes, 3)."""
        before, after, right, left = self.neighbours
        along_x = (position[after] - position[before]).mean(axis=0)
        along_y = (position[left] - position[right]).mean(axis=0)
        normal = _cross(along_x, along_y)
        axes = np.empty((3, 3))
        axes[:, 0] = along_x / math.sqrt(along_x @ along_x)
        axes[:, 2] = normal / math.sqrt(normal @ normal)
        axes[:, 1] = _cross(axes[:, 2], axes[:, 0])
        return axes

    def pose(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m], shape (3,), and orientation as a unit quaternion x, y, z, w, shape (4,)."""
        return self.position(position), quaternion(self.frame(position))

    def moment_as_nodal_forces(
        self, position: np.ndarray, torque: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the nodes of the patch and forces on them [N], shape (n, 3), equivalent to a torque [N m].

        Point masses have no rotation of their own, so the torque becomes forces of least norm with zero sum and
        that moment. About the patch's centroid f = alpha x r, with (sum |r|^2 1 - r r^T) alpha = torque.
        """
        arm = position[self.patch] - position[self.patch].mean(axis=0)
        inertia = np.sum(arm**2) * np.eye(3) - arm.T @ arm
        return self.patch, np.cross(np.linalg.solve(inertia, torque), arm)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # np.cross of two single vectors takes ten times as long.
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def quaternion(axes: np.ndarray) -> np.ndarray:
    """Return the unit quaternion x, y, z, w (w >= 0) of a rotation matrix, by its largest component (Shepperd)."""
    m = axes
    trace = np.trace(m)
    choices = np.array([m[0, 0], m[1, 1], m[2, 2], trace])
    largest = int(np.argmax(choices))
    if largest == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + trace])
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[i] = 1.0 + m[i, i] - m[j, j] - m[k, k]
        q[j] = m[i, j] + m[j, i]
        q[k] = m[i, k] + m[k, i]
        q[3] = m[k, j] - m[j, k]
    q /= np.linalg.norm(q)
    return -q if q[3] < 0.0 else q


def point_at(lattice: Lattice, place: object, points: dict[str, Point] | None = None) -> Point:
    """Return the point for a name of `points`, 'node_<layer>_<i>_<j>', or [layer, i, j], with i and j numbers or words.

    `centre` and `free_edge` (or [layer, centre]) name the centre and the middle of the free edge at any
    resolution.

    Raises:
        ValueError: There is no such place; says which there are.
    """
    if isinstance(place, str):
        if points and place in points:
            return points[place]
        match = NODE_NAME.match(place)
        if match:
            return point_at(lattice, [match[1], int(match[2]), int(match[3])])
        if place in NAMED_PLACES:
            return point_at(lattice, ["mid", place])
        known = sorted(points or {}) + ["centre", "free_edge", "node_<layer>_<i>_<j>"]
        raise ValueError(f"got {place!r}, expected a point out of {known}, or [layer, i, j]")
    if not isinstance(place, (list, tuple)) or len(place) not in (2, 3) or place[0] not in POINT_LAYERS:
        raise ValueError(f"got {place!r}, expected [layer, i, j] with layer one of {list(POINT_LAYERS)}")
    layers = (0, 1) if place[0] == "mid" else (LAYERS.index(place[0]),)
    nx, ny = lattice.nodes
    if len(place) == 2:
        if place[1] not in NAMED_PLACES:
            raise ValueError(
                f"got {place[1]!r}, expected one of {list(NAMED_PLACES)}, or two whole numbers i, j"
            )
        columns = _middle(nx) if place[1] == "centre" else (nx - 1,)
        return Point(lattice, layers, columns, _middle(ny))
    for index in place[1:]:
        if isinstance(index, bool) or not isinstance(index, int):
            raise ValueError(f"got {place!r}, expected whole numbers for i and j")
    lattice.node(layers[0], place[1], place[2])
    return Point(lattice, layers, (place[1],), (place[2],))


def _middle(n: int) -> tuple[int, ...]:
    return (n // 2,) if n % 2 else (n // 2 - 1, n // 2)

"""Named points of the sheet, their moving frames, and how a force or torque there acts on nodes."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.physics.lattice import LAYERS, Lattice
from ldcs_ros.schema.fields import SheetPlace

# Nodes on a line: the square of the sine between two tangents, or the smallest share of inertia.
FLAT = 1e-24
NODE_NAME = re.compile(r"^node_(bottom|top)_(\d+)_(\d+)$")
POINT_LAYERS = (*LAYERS, "mid")
NAMED_PLACES = ("centre", "free_edge")


class DegenerateShapeError(DivergenceError, np.linalg.LinAlgError):
    """A shape without orientation. A step that meets it is tried again shorter, as after a singular matrix."""


@dataclass(frozen=True, eq=False)
class Stencil:
    """A weighted mean of nodes.

    Attributes:
        nodes: Indices of the nodes, shape (n,).
        weight: Their weights, shape (n,); the mean divides by the sum.
    """

    nodes: np.ndarray
    weight: np.ndarray

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Stencil):
            return NotImplemented
        return np.array_equal(self.nodes, other.nodes) and np.array_equal(self.weight, other.weight)

    def __hash__(self) -> int:
        return hash((self.nodes.tobytes(), self.weight.tobytes()))

    @cached_property
    def total(self) -> float:
        """Sum of the weights."""
        return float(self.weight.sum())

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of values of all nodes, shape (n_nodes, 3), shape (3,)."""
        return np.asarray((self.weight[:, None] * values[self.nodes]).sum(axis=0) / self.total)

    def minus(self, other: Stencil, values: np.ndarray) -> np.ndarray:
        """Return the mean less that of another stencil of as many nodes and the same sum of weights, shape (3,)."""
        here, there = self.weight[:, None] * values[self.nodes], other.weight[:, None] * values[other.nodes]
        return np.asarray((here - there).sum(axis=0) / self.total)


@dataclass(frozen=True)
class Point:
    """A point that moves with the sheet: the mean of a block of nodes, or the bilinear point between nodes.

    Its frame rotates with the sheet. x is along the lattice's x direction there, z along the normal (tangent in x
    times tangent in y), and y completes it. On the flat sheet it is parallel to `ldcs_base`.

    Attributes:
        where: Its place in words.
        layers: Layers that it averages: (0,) bottom, (1,) top, (0, 1) mid.
        stencil: The nodes that it is the mean of.
        behind: The same a cell before it along x, or itself at an edge or a hole.
        ahead: The same a cell after it along x.
        right: The same a cell before it along y.
        left: The same a cell after it along y.
        patch: Nodes around the point that take up a torque: both layers, up to one cell away, shape (n,).
    """

    where: str
    layers: tuple[int, ...]
    stencil: Stencil
    behind: Stencil
    ahead: Stencil
    right: Stencil
    left: Stencil
    patch: np.ndarray = field(compare=False)

    @property
    def nodes(self) -> np.ndarray:
        """Indices of the nodes that it averages, shape (n,)."""
        return self.stencil.nodes

    @cached_property
    def fraction(self) -> np.ndarray:
        """Fraction of a load or mass at the point that each of its nodes takes, shape (n,); their sum is 1."""
        return self.stencil.weight / self.stencil.total

    def position(self, position: np.ndarray) -> np.ndarray:
        """Return the position of the point [m], shape (3,), from node positions of shape (n_nodes, 3)."""
        return self.stencil.mean(position)

    def frame(self, position: np.ndarray) -> np.ndarray:
        """Return the axes of its frame as columns, shape (3, 3), from node positions [m] of shape (n_nodes, 3).

        Raises:
            DegenerateShapeError: The nodes around it lie on a line.
        """
        along_x = self.ahead.minus(self.behind, position)
        along_y = self.left.minus(self.right, position)
        normal = _cross(along_x, along_y)
        if normal @ normal <= FLAT * (along_x @ along_x) * (along_y @ along_y):
            raise DegenerateShapeError(
                f"{self.where}: the nodes around it lie on a line or in one place, so that it has no orientation; "
                "check the node positions, loads and stiffness there"
            )
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

        Raises:
            DegenerateShapeError: The nodes of the patch are on one line.
        """
        arm = position[self.patch] - position[self.patch].mean(axis=0)
        inertia = np.sum(arm**2) * np.eye(3) - arm.T @ arm
        if np.linalg.det(inertia) <= FLAT * (np.trace(inertia) / 3.0) ** 3:
            raise DegenerateShapeError(
                f"{self.where}: the nodes around it lie on a line or in one place and take up no torque about it; "
                "check the node positions, loads and stiffness there"
            )
        return self.patch, np.cross(np.linalg.solve(inertia, torque), arm)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # np.cross of two single vectors takes ten times as long.
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def quaternion(axes: np.ndarray) -> np.ndarray:
    """Return the unit quaternion x, y, z, w (w >= 0), shape (4,), of a rotation matrix (Shepperd's method)."""
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
    """Return the point of a place: a name of `points`, 'node_<layer>_<i>_<j>', [layer, i, j], or a `SheetPlace`.

    `centre` and `free_edge` (or [layer, centre]) name the centre and the middle of the free edge at any
    resolution.

    Raises:
        ValueError: There is no such place, or it is in a hole; says which there are.
    """
    if isinstance(place, SheetPlace):
        return _between_nodes(lattice, place)
    if isinstance(place, str):
        if points and place in points:
            return points[place]
        match = NODE_NAME.match(place)
        if match:
            return point_at(lattice, [match[1], int(match[2]), int(match[3])])
        if place in NAMED_PLACES:
            return point_at(lattice, ["mid", place])
        known = [*sorted(points or {}), "centre", "free_edge", "node_<layer>_<i>_<j>"]
        raise ValueError(f"got {place!r}, expected a point out of {known}, [layer, i, j], or {{x, y, layer}}")
    if not isinstance(place, (list, tuple)) or len(place) not in (2, 3) or place[0] not in POINT_LAYERS:
        raise ValueError(
            f"got {place!r}, expected [layer, i, j] with layer one of {list(POINT_LAYERS)}, or {{x, y, layer}}"
        )
    layers = _layers(place[0])
    nx, ny = lattice.nodes
    if len(place) == 2:
        if place[1] not in NAMED_PLACES:
            raise ValueError(
                f"got {place[1]!r}, expected one of {list(NAMED_PLACES)}, or two whole numbers i, j"
            )
        columns = _middle(nx) if place[1] == "centre" else (nx - 1,)
        return _block(lattice, layers, columns, _middle(ny))
    for index in place[1:]:
        if isinstance(index, bool) or not isinstance(index, int):
            raise ValueError(f"got {place!r}, expected whole numbers for i and j")
    lattice.node(layers[0], place[1], place[2])
    return _block(lattice, layers, (place[1],), (place[2],))


def _layers(name: str) -> tuple[int, ...]:
    return (0, 1) if name == "mid" else (LAYERS.index(name),)


def _middle(n: int) -> tuple[int, ...]:
    return (n // 2,) if n % 2 else (n // 2 - 1, n // 2)


def _block(
    lattice: Lattice, layers: tuple[int, ...], columns: tuple[int, ...], rows: tuple[int, ...]
) -> Point:
    """Return the mean of a block of nodes.

    Raises:
        ValueError: One of them is in a hole.
    """
    (nx, ny), (x, y) = lattice.nodes, (columns, rows)

    def stencil(columns: tuple[int, ...], rows: tuple[int, ...]) -> Stencil:
        nodes = lattice.index[np.ix_(layers, columns, rows)].ravel()
        return Stencil(nodes, np.ones(len(nodes)))

    here = stencil(x, y)
    where = " and ".join(map(str, x)), " and ".join(map(str, y))
    if np.isin(here.nodes, lattice.missing).any():
        raise ValueError(f"the node at column {where[0]}, row {where[1]} is in a hole")
    around = (
        stencil((max(x[0] - 1, 0),), y),
        stencil((min(x[-1] + 1, nx - 1),), y),
        stencil(x, (max(y[0] - 1, 0),)),
        stencil(x, (min(y[-1] + 1, ny - 1),)),
    )
    patch = lattice.index[:, max(x[0] - 1, 0) : x[-1] + 2, max(y[0] - 1, 0) : y[-1] + 2].ravel()
    return _point(lattice, f"column {where[0]}, row {where[1]}", layers, here, around, patch)


def stencil_at(lattice: Lattice, place: SheetPlace) -> Stencil:
    """Return the corners around a place on the flat sheet and their bilinear weights, those of weight 0 too.

    Raises:
        ValueError: The place is outside of the sheet or in a hole.
    """
    corners = [lattice.bilinear(layer, place.x, place.y) for layer in _layers(place.layer)]
    return Stencil(np.concatenate([one[0] for one in corners]), np.concatenate([one[1] for one in corners]))


def _between_nodes(lattice: Lattice, place: SheetPlace) -> Point:
    """Return the bilinear point of a place on the flat sheet.

    Raises:
        ValueError: It is outside of the sheet or in a hole.
    """
    layers, (dx, dy) = _layers(place.layer), lattice.spacing
    length, width = lattice.size[:2]
    here = stencil_at(lattice, place)
    around = []
    for move_x, move_y in ((-dx, 0.0), (dx, 0.0), (0.0, -dy), (0.0, dy)):
        x, y = min(max(place.x + move_x, 0.0), length), min(max(place.y + move_y, -0.5 * width), 0.5 * width)
        try:
            around.append(stencil_at(lattice, SheetPlace(x, y, place.layer)))
        except ValueError:  # a hole is there
            around.append(here)
    i, j = place.x / dx, (place.y + 0.5 * width) / dy
    columns, rows = (slice(max(math.ceil(n - 1.0 - 1e-6), 0), math.floor(n + 1.0 + 1e-6) + 1) for n in (i, j))
    patch = lattice.index[:, columns, rows].ravel()
    return _point(lattice, f"x {place.x:g} m, y {place.y:g} m", layers, here, tuple(around), patch)


def _point(
    lattice: Lattice,
    where: str,
    layers: tuple[int, ...],
    here: Stencil,
    around: tuple[Stencil, ...],
    patch: np.ndarray,
) -> Point:
    # At a hole the point itself replaces a missing neighbour, as at an edge.
    behind, ahead, right, left = (
        here if np.isin(one.nodes[one.weight > 0.0], lattice.missing).any() else one for one in around
    )
    pairs = [_same_corners(*pair) for pair in ((behind, ahead), (right, left))]
    here = _same_corners(here, here)[0]
    patch = patch[~np.isin(patch, lattice.missing)]
    for axis, (one, other) in zip("xy", pairs, strict=True):
        if np.allclose(one.mean(lattice.reference_position), other.mean(lattice.reference_position)):
            raise ValueError(f"{where} has no neighbours along {axis}: its frame is not defined")
    return Point(where, layers, here, *pairs[0], *pairs[1], patch)


def _same_corners(one: Stencil, other: Stencil) -> tuple[Stencil, Stencil]:
    # A point on a node, or on a line of nodes, needs no corners of weight 0.
    if len(one.nodes) != len(other.nodes):
        return one, other
    used = (one.weight > 0.0) | (other.weight > 0.0)
    return _restricted(one, used), _restricted(other, used)


def _restricted(stencil: Stencil, used: np.ndarray) -> Stencil:
    # A corner of weight 0 may be a node in a hole, whose position is NaN; another one replaces it.
    nodes, weight = stencil.nodes[used], stencil.weight[used]
    return Stencil(np.where(weight > 0.0, nodes, nodes[np.argmax(weight)]), weight)

"""Shapes that the whole sheet shall take: spheres, cylinders, saddles, sines, measured moulds, heights of nodes."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator, RectBivariateSpline, griddata
from scipy.spatial import QhullError

from ldcs_ros.errors import SceneError
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.schema.reader import read_text

Height = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Height [m] of a surface at places x, y in ldcs_base [m], and its slopes along x and y."""

_NUMBERS = {
    "sphere": ("radius", "x", "y", "z"),
    "cylinder": ("radius", "x", "y", "z"),
    "saddle": ("radius", "x", "y", "z"),
    "sine": ("amplitude", "length", "x", "y", "z"),
}
_WITH_AXIS = ("cylinder", "sine")
SHAPE_NAMES = tuple(_NUMBERS)
"""Names of the shapes that need no file."""
_FINE = 65  # nodes of the spline of a measured mould, along each side
_NEAR = 64  # measured points that a height between them depends on


@dataclass(frozen=True)
class ShapeTarget:
    """Heights that the middle of the sheet shall have: above every node, the mean of bottom and top counts.

    The residual of a node is the vertical distance from its own place to the shape. The weighted residuals have the
    RMS as their norm.

    Attributes:
        name: Its name, for people.
        nodes: Indices of the bottom and the top node of each place, shape (n, 2).
        weight: Weight of each place, shape (n,), not negative.
        height: The shape.
        free_height: Whether the shape may lie at any height; the best one is taken.
    """

    name: str
    nodes: np.ndarray
    weight: np.ndarray
    height: Height
    free_height: bool

    def error(self, q: np.ndarray) -> np.ndarray:
        """Return the height of each place above the shape [m], shape (n,), from the coordinates of a model."""
        x, y, z = self._middle(q)
        return self._less_mean(z - self.height(x, y)[0])

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Return `error` times the root of each place's fraction of the weight, shape (n,): the norm is the RMS [m]."""
        return self._root * self.error(q)

    def slope(self, q: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return the derivatives of `residual`, shape (n, k), from those of the coordinates, shape (n_q, k)."""
        x, y, _ = self._middle(q)
        _, by_x, by_y = self.height(x, y)
        columns = []
        for move in moves.T:
            along_x, along_y, up = self._middle(move)
            columns.append(self._root * self._less_mean(up - by_x * along_x - by_y * along_y))
        return np.stack(columns, axis=1)

    @property
    def _root(self) -> np.ndarray:
        return np.sqrt(self.weight / self.weight.sum())

    def _middle(self, flat: np.ndarray) -> np.ndarray:
        last = int(self.nodes.max()) + 1
        return np.array(flat[: 3 * last].reshape(-1, 3)[self.nodes].mean(axis=1).T)

    def _less_mean(self, values: np.ndarray) -> np.ndarray:
        return values - np.average(values, weights=self.weight) if self.free_height else values


def shape_target(text: str, lattice: Lattice) -> ShapeTarget:
    """Return the shape of a text.

    Args:
        text: `sphere:radius=0.5`, `cylinder:radius=0.5,axis=y`, `saddle:radius=0.5`,
            `sine:amplitude=0.01,length=0.2,axis=x`, or the path of a CSV file with the columns x, y, z (points of a
            surface in ldcs_base [m]) or i, j, z (heights of nodes [m]), and weight where wanted. A positive radius
            is a dome, a negative one a bowl. x and y are the shape's middle; without them it is the sheet's.
            `z=0.01` fixes its height, `z=free` does not; files are fixed without it, other shapes are free.
        lattice: The sheet.

    Raises:
        ValueError: There is no such shape, or a number of it is missing or not sound.
        SceneError: The file cannot be read.
    """
    name, options = _name_and_options(text)
    if name in _NUMBERS:
        return _analytic(name, options, lattice)
    unknown = set(options) - {"z"}
    if not name.endswith(".csv") or unknown:
        raise ValueError(
            f"got {text!r}, expected {', '.join(SHAPE_NAMES)} with numbers such as sphere:radius=0.5, or a .csv file"
        )
    z = options.get("z", "0")
    return _from_file(Path(name), 0.0 if z == "free" else _number("z", z), z == "free", lattice)


def _name_and_options(text: str) -> tuple[str, dict[str, str]]:
    name, _, rest = text.partition(":")
    options: dict[str, str] = {}
    for word in filter(None, rest.split(",")):
        key, equals, value = word.partition("=")
        if not equals or key in options:
            raise ValueError(f"got {word!r} in {text!r}, expected each key once, as in radius=0.5")
        options[key] = value
    return name, options


def _analytic(name: str, options: dict[str, str], lattice: Lattice) -> ShapeTarget:
    axis = options.pop("axis", "x" if name == "sine" else "y")
    free = options.get("z", "free") == "free"
    given = {key: _number(key, value) for key, value in options.items() if (key, value) != ("z", "free")}
    required = _NUMBERS[name][:-3]
    known = (*_NUMBERS[name], *(("axis",) if name in _WITH_AXIS else ()))
    if set(given) - set(known) or not set(required) <= set(given) or axis not in ("x", "y"):
        raise ValueError(f"got {name} with {', '.join(given) or 'nothing'}, expected {', '.join(known)}")
    numbers = {"x": 0.5 * lattice.size[0], "y": 0.0, "z": 0.0, **given}
    nodes = _places(lattice)
    flat = lattice.reference_position[nodes[:, 0], :2]
    far = float(np.linalg.norm(flat - [numbers["x"], numbers["y"]], axis=1).max())
    if "radius" in required and not abs(numbers["radius"]) > far:
        raise ValueError(
            f"radius: got {numbers['radius']:g} m, expected more than the distance {far:.4g} m of the farthest node"
        )
    if name == "sine" and not numbers["length"] > 0.0:
        raise ValueError(f"length: got {numbers['length']:g} m, expected a wave length above 0 m")
    return ShapeTarget(name, nodes, np.ones(len(nodes)), _height(name, axis, numbers), free)


def _height(name: str, axis: str, numbers: Mapping[str, float]) -> Height:
    x0, y0, z0 = numbers["x"], numbers["y"], numbers["z"]
    if name == "sine":
        amplitude, wave = numbers["amplitude"], 2.0 * math.pi / numbers["length"]

        def sine(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            phase = wave * (x - x0 if axis == "x" else y - y0)
            along, still = amplitude * wave * np.cos(phase), np.zeros_like(phase)
            height = z0 + amplitude * np.sin(phase)
            return (height, along, still) if axis == "x" else (height, still, along)

        return sine
    radius = numbers["radius"]
    if name == "saddle":

        def saddle(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            dx, dy = x - x0, y - y0
            return z0 + 0.5 * (dx * dx - dy * dy) / radius, dx / radius, -dy / radius

        return saddle
    # The axis of a cylinder is the direction that it is straight along.
    curved = {"sphere": (1.0, 1.0), "x": (0.0, 1.0), "y": (1.0, 0.0)}[name if name == "sphere" else axis]

    def cap(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        dx, dy = curved[0] * (x - x0), curved[1] * (y - y0)
        # Nodes that slide out to the equator have a finite slope still.
        depth = np.sqrt(np.maximum(radius * radius - dx * dx - dy * dy, 1e-4 * radius * radius))
        sign = math.copysign(1.0, radius)
        return z0 + sign * (depth - abs(radius)), -sign * dx / depth, -sign * dy / depth

    return cap


def _from_file(path: Path, z: float, free: bool, lattice: Lattice) -> ShapeTarget:
    columns, rows = _table(path)
    weight = rows[:, 3] if rows.shape[1] > 3 else np.ones(len(rows))
    if np.any(weight < 0.0) or not weight.sum() > 0.0:
        raise ValueError(f"{path}: expected weights of 0 or above, some above 0")
    if columns[0] == "i":
        return _node_heights(path, rows, weight, z, free, lattice)
    nodes = _places(lattice)
    flat = lattice.reference_position[nodes[:, 0], :2]
    try:
        surface = RBFInterpolator(rows[:, :2], rows[:, 2], neighbors=min(_NEAR, len(rows)))
        within = griddata(rows[:, :2], weight, flat, fill_value=0.0)
    except (QhullError, np.linalg.LinAlgError, ValueError) as error:
        raise ValueError(
            f"{path}: got {len(rows)} points, expected at least 3 different ones that span a plane"
        ) from error
    if not within.sum() > 0.0:
        raise ValueError(f"{path}: expected points around the sheet, in ldcs_base [m]")
    # One smooth function with slopes for all places; outside of the points it goes on level.
    low, high = rows[:, :2].min(axis=0), rows[:, :2].max(axis=0)
    xs, ys = (np.linspace(low[k], high[k], _FINE) for k in range(2))
    grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    spline = RectBivariateSpline(xs, ys, surface(grid).reshape(_FINE, _FINE), s=0.0)

    def height(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return z + spline.ev(x, y), spline.ev(x, y, dx=1), spline.ev(x, y, dy=1)

    used = within > 0.0
    return ShapeTarget(path.name, nodes[used], within[used], height, free)


def _node_heights(
    path: Path, rows: np.ndarray, weight: np.ndarray, z: float, free: bool, lattice: Lattice
) -> ShapeTarget:
    place = rows[:, :2].astype(int)
    inside = np.all((place >= 0) & (place < lattice.nodes), axis=1) & np.all(place == rows[:, :2], axis=1)
    i, j = np.where(inside[:, None], place, 0).T
    index = lattice.index[:, i, j].T
    bad = ~inside | np.isin(index, lattice.missing).any(axis=1)
    if bad.any() or len(np.unique(index[:, 0])) < len(index):
        wrong = rows[np.argmax(bad), :2] if bad.any() else "one twice"
        raise ValueError(
            f"{path}: got node {wrong}, expected i, j of nodes: {list(lattice.nodes)}, outside of holes, each once"
        )
    wanted, used = z + rows[:, 2], weight > 0.0
    wanted = wanted[used]

    def height(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return wanted, np.zeros_like(x), np.zeros_like(y)

    return ShapeTarget(path.name, index[used], weight[used], height, free)


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    text = read_text(path, "target shape", SceneError).removeprefix("\ufeff")
    try:
        lines = [row for row in csv.reader(text.splitlines()) if any(word.strip() for word in row)]
    except csv.Error as error:
        raise ValueError(f"{path} is no table: {error}") from None
    columns = [word.strip() for word in lines[0]] if lines else []
    if columns[:3] not in (["x", "y", "z"], ["i", "j", "z"]) or columns[3:] not in ([], ["weight"]):
        raise ValueError(f"{path}: got columns {columns}, expected x,y,z or i,j,z, and weight where wanted")
    try:
        rows = np.array([[float(word) for word in row] for row in lines[1:]])
        if rows.ndim != 2 or rows.shape[1] != len(columns) or not np.isfinite(rows).all():
            raise ValueError
    except ValueError:
        raise ValueError(
            f"{path}: expected {len(columns)} finite numbers in each row, at least one row"
        ) from None
    return columns, rows


def _places(lattice: Lattice) -> np.ndarray:
    """Return the bottom and the top node of each place of the sheet, shape (n, 2); none in holes."""
    pairs = lattice.index.reshape(2, -1).T
    return np.array(pairs[~np.isin(pairs, lattice.missing).any(axis=1)])


def _number(key: str, text: str) -> float:
    try:
        value = float(text)
        if not math.isfinite(value):
            raise ValueError
    except ValueError:
        raise ValueError(f"{key}: got {text!r}, expected a finite number") from None
    return value

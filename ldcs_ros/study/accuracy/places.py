"""Places of a lattice for the independent equations: the nodes that a point averages, its frame and its patch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Place:
    """A block of nodes.

    Attributes:
        layers: Its layers.
        columns: Its indices along x.
        rows: Its indices along y.
    """

    layers: tuple[int, ...]
    columns: tuple[int, ...]
    rows: tuple[int, ...]

    def nodes(self, grid: np.ndarray) -> np.ndarray:
        """Return the block's nodes, given (layer, i, j) of all nodes, shape (n, 3)."""
        return self.within(grid, 0)

    def patch(self, grid: np.ndarray) -> np.ndarray:
        """Return the nodes of both layers up to one cell away, shape (n,)."""
        return Place((0, 1), self.columns, self.rows).within(grid, 1)

    def within(self, grid: np.ndarray, reach: int) -> np.ndarray:
        """Return the nodes of its layers up to `reach` cells away, shape (n,)."""
        layer, i, j = grid.T
        near = np.isin(layer, self.layers)
        near &= (i >= min(self.columns) - reach) & (i <= max(self.columns) + reach)
        near &= (j >= min(self.rows) - reach) & (j <= max(self.rows) + reach)
        return np.flatnonzero(near)


def place_of(at: str | Sequence[str | int], shape: tuple[int, ...], points: dict[str, Place]) -> Place:
    """Return the place of a scene's word: a point's name, node_<layer>_<i>_<j>, centre, free_edge or a list."""
    if isinstance(at, str) and at in points:
        return points[at]
    words: list[str | int]
    if not isinstance(at, str):
        words = list(at)
    elif at.startswith("node_"):
        words = [int(word) if word.isdigit() else word for word in at.split("_")[1:]]
    else:
        words = ["mid", at]
    layer, *rest = words
    layers = {"bottom": (0,), "top": (1,), "mid": (0, 1)}[str(layer)]
    nx, ny = shape
    if len(rest) == 2:
        return Place(layers, (int(rest[0]),), (int(rest[1]),))
    middle = [(m // 2,) if m % 2 else (m // 2 - 1, m // 2) for m in (nx, ny)]
    return Place(layers, middle[0] if rest[0] == "centre" else (nx - 1,), middle[1])


def frame_of(place: Place, shape: tuple[int, ...], grid: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the axes of a place's moving frame as columns, shape (3, 3), from node positions [m]."""
    nx, ny = shape

    def mean(columns: tuple[int, ...], rows: tuple[int, ...]) -> np.ndarray:
        return np.asarray(x[Place(place.layers, columns, rows).nodes(grid)].mean(axis=0))

    low, high = max(place.columns[0] - 1, 0), min(place.columns[-1] + 1, nx - 1)
    right, left = max(place.rows[0] - 1, 0), min(place.rows[-1] + 1, ny - 1)
    along = mean((high,), place.rows) - mean((low,), place.rows)
    across = mean(place.columns, (left,)) - mean(place.columns, (right,))
    first = along / np.linalg.norm(along)
    normal = np.cross(along, across)
    third = normal / np.linalg.norm(normal)
    return np.stack([first, np.cross(third, first), third], axis=1)

"""Plane shapes on the flat sheet: where holes and regions are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class PlaneShape(Protocol):
    """A closed area in the x-y plane of ldcs_base [m]."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return a signed distance to the outline [m], negative inside, for points of shape (n, 2); shape (n,)."""


@dataclass(frozen=True)
class Rectangle:
    """A rectangle with sides along x and y.

    Attributes:
        corners: x and y of one corner, x and y of the opposite one [m].
    """

    corners: tuple[float, float, float, float]

    def distance(self, points: np.ndarray) -> np.ndarray:
        x0, y0, x1, y1 = self.corners
        low, high = np.array([min(x0, x1), min(y0, y1)]), np.array([max(x0, x1), max(y0, y1)])
        # Largest excess over a side: exact inside, and of the right sign outside.
        return np.asarray(np.maximum(low - points, points - high).max(axis=1))


@dataclass(frozen=True)
class Disc:
    """A disc.

    Attributes:
        centre: Its centre [m].
        radius: Its radius [m].
    """

    centre: tuple[float, float]
    radius: float

    def distance(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(points - np.array(self.centre), axis=1) - self.radius)


@dataclass(frozen=True)
class Polygon:
    """A polygon; inside is what a ray from there leaves through an odd number of sides.

    Attributes:
        corners: Its corners in order [m].
    """

    corners: tuple[tuple[float, float], ...]

    def distance(self, points: np.ndarray) -> np.ndarray:
        begin = np.array(self.corners)
        end = np.roll(begin, -1, axis=0)
        nearest, crossings = np.full(len(points), np.inf), np.zeros(len(points), dtype=int)
        for a, b in zip(begin, end, strict=True):
            side = b - a
            along = np.clip((points - a) @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
            nearest = np.minimum(nearest, np.linalg.norm(points - a - along[:, None] * side, axis=1))
            spans = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
            rise = np.where(side[1] != 0.0, side[1], 1.0)
            crossings += spans & (points[:, 0] < a[0] + (points[:, 1] - a[1]) / rise * side[0])
        return np.where(crossings % 2 == 1, -nearest, nearest)


@dataclass(frozen=True)
class SheetRegion:
    """A part of the sheet with properties of its own, as factors of the sheet's.

    Attributes:
        shape: Its shape.
        stiffness: Factor of the springs' stiffness.
        damping: Factor of the dampers' coefficient.
        mass: Factor of the nodes' mass.
        thickness: Factor of the distance between the layers; a material's stiffness and mass follow it.
    """

    shape: PlaneShape
    stiffness: float = 1.0
    damping: float = 1.0
    mass: float = 1.0
    thickness: float = 1.0

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
        """Return the signed excess over the outline [m], shape (n,), for points of shape (n, 2)."""
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
        """Return the signed distance to the outline [m], shape (n,), for points of shape (n, 2)."""
        return np.asarray(np.linalg.norm(points - np.array(self.centre), axis=1) - self.radius)


_ROUNDING = 1e-9
"""Sine of an angle, and fraction of a side, that count as none."""


@dataclass(frozen=True)
class Polygon:
    """A polygon; inside is what a ray from there leaves through an odd number of sides.

    Attributes:
        corners: Its corners in order [m].
    """

    corners: tuple[tuple[float, float], ...]

    def crossing(self) -> tuple[float, float] | None:
        """Return a place [m] where the outline meets itself; None for a simple polygon. A repeated corner is one."""
        corners = np.array(self.corners)
        corners = corners[(corners != np.roll(corners, -1, axis=0)).any(axis=1)]
        side = np.roll(corners, -1, axis=0) - corners
        after = np.roll(side, -1, axis=0)
        sizes = np.linalg.norm(side, axis=1) * np.linalg.norm(after, axis=1)
        back = (np.abs(_cross(side, after)) <= _ROUNDING * sizes) & ((side * after).sum(axis=1) < 0.0)
        met = np.roll(corners, -1, axis=0)[back]
        for i in range(len(corners) - 2):
            # The last side is a neighbour of the first. Parallel sides that overlap have corners on others.
            others = np.arange(i + 2, len(corners) - (i == 0))
            across = _cross(side[i], side[others])
            apart = corners[others] - corners[i]
            others, apart, across = others[across != 0.0], apart[across != 0.0], across[across != 0.0]
            along = np.stack([_cross(apart, side[others]), _cross(apart, side[i])]) / across
            hit = ((along >= -_ROUNDING) & (along <= 1.0 + _ROUNDING)).all(axis=0)
            met = np.concatenate([met, corners[i] + along[0][hit, None] * side[i]])
        return (float(met[0, 0]), float(met[0, 1])) if len(met) else None

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance to the outline [m], shape (n,), for points of shape (n, 2)."""
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


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


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

"""Regions of space, and which line segments meet them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Corner = tuple[float, float, float]


class Region(ABC):
    """A closed region of space."""

    @classmethod
    @abstractmethod
    def of(cls, points: Sequence[Corner]) -> Region:
        """Return the region that two points describe; ValueError for what describes none."""

    @abstractmethod
    def meets(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Tell which segments meet it, from where they begin and end [m], shape (n, 3); shape (n,)."""


@dataclass(frozen=True)
class Box(Region):
    """An axis-aligned box.

    Attributes:
        low: Its corner with the smallest coordinates [m], shape (3,).
        high: The opposite one [m], shape (3,).
    """

    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, points: Sequence[Corner]) -> Box:
        """Return the box between two opposite corners, in any order."""
        corners = _two(points, "a box by two opposite corners")
        return cls(corners.min(axis=0), corners.max(axis=0))

    def meets(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Tell which segments meet it: whether the parts inside the three slabs have something in common."""
        way = end - begin
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (self.low - begin) / way, (self.high - begin) / way
        # A segment along a slab is in all of it or in none of it.
        inside = (self.low <= begin) & (begin <= self.high)
        enter = np.where(way == 0.0, np.where(inside, -np.inf, np.inf), np.minimum(one, other))
        leave = np.where(way == 0.0, np.where(inside, np.inf, -np.inf), np.maximum(one, other))
        met: np.ndarray = np.maximum(enter.max(axis=1), 0.0) <= np.minimum(leave.min(axis=1), 1.0)
        return met


@dataclass(frozen=True)
class Sphere(Region):
    """A sphere.

    Attributes:
        centre: Its centre [m], shape (3,).
        radius: Its radius [m].
    """

    centre: np.ndarray
    radius: float

    @classmethod
    def of(cls, points: Sequence[Corner]) -> Sphere:
        """Return the sphere by its centre and, in x of the second point, its radius."""
        centre, second = _two(points, "a sphere by its centre and, in x of the second point, its radius")
        if second[0] < 0.0:
            raise ValueError(f"bounds with a radius of {second[0]:g} m, expected 0 and more")
        return cls(centre, float(second[0]))

    def meets(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Tell which segments meet it: whether their nearest points are inside."""
        way = end - begin
        length = np.sum(way**2, axis=1)
        along = np.sum((self.centre - begin) * way, axis=1) / np.where(length > 0.0, length, 1.0)
        nearest = begin + np.clip(along, 0.0, 1.0)[:, None] * way
        met: np.ndarray = np.linalg.norm(nearest - self.centre, axis=1) <= self.radius
        return met


def _two(points: Sequence[Corner], what: str) -> np.ndarray:
    pair = np.array(points, dtype=float)
    if pair.shape != (2, 3) or not np.isfinite(pair).all():
        raise ValueError(f"bounds with {len(points)} points, expected {what}, all finite")
    return pair

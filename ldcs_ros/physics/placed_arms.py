"""Arms as lines on the flat sheet: name, base and tip, and the numbers that one arm has of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product

import numpy as np

from ldcs_ros.physics.lattice import Lattice


@dataclass(frozen=True)
class PlacedArm:
    """One arm of the list: a straight line on the flat sheet.

    Attributes:
        name: Its name, which begins the names of its joints and topics.
        start: Its base, x and y on the flat sheet in ldcs_base [m].
        end: Its tip, likewise [m].
        own: Its own values of parameters of `Arms`, by name.
    """

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    own: Mapping[str, object] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Its length on the flat sheet [m]."""
        return math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def direction(self) -> np.ndarray:
        """Unit vector from base to tip in x and y, shape (2,)."""
        return np.array([self.end[0] - self.start[0], self.end[1] - self.start[1]]) / self.length

    def check_ends(self, lattice: Lattice, which: str) -> None:
        """Check that base and tip are two places on a lattice's sheet.

        Args:
            lattice: The lattice.
            which: Words before the message that name the arm; '' where there is no list.

        Raises:
            ValueError: They are not.
        """
        for key, (x, y) in (("from", self.start), ("to", self.end)):
            if not lattice.covers(x, y):
                raise ValueError(f"{which}{key}: {lattice.outside(x, y)}")
        if self.length <= 0.0:
            raise ValueError(f"{which}from and to: got the same place, expected a line on the sheet")

    def covered(
        self, links: int, width: int, lattice: Lattice
    ) -> tuple[tuple[int, np.ndarray, np.ndarray], ...]:
        """Return what the ribs of a straight arm cover: joint station, corners and bilinear weights, shape (4,) each.

        The order is station (base, then the end of each link), row (the line, then pairs to its right and left),
        layer. Rows outside of the sheet are left out.

        Args:
            links: Number of links.
            width: Rows on each side of the line.
            lattice: The lattice.
        """
        return _covered(self.start, self.end, links, width, lattice)

    def check_holes(self, lattice: Lattice) -> None:
        """Check that the line crosses no hole of a lattice.

        Raises:
            ValueError: It does; the message says where.
        """
        # Half a cell from point to point: no hole between two joint stations is missed.
        for fraction in np.linspace(0.0, 1.0, 2 * max(lattice.nodes)):
            x, y = (a + fraction * (b - a) for a, b in zip(self.start, self.end, strict=True))
            try:
                lattice.bilinear(0, x, y)
            except ValueError as error:
                raise ValueError(
                    f"arm {self.name!r} crosses a hole at x = {x:g}, y = {y:g} m, expected a line on the sheet"
                ) from error


# Scenes that differ in other numbers share it.
@lru_cache(maxsize=64)
def _covered(
    start: tuple[float, float], end: tuple[float, float], links: int, width: int, lattice: Lattice
) -> tuple[tuple[int, np.ndarray, np.ndarray], ...]:
    dx, dy = PlacedArm("", start, end).direction
    cell = abs(dy) * lattice.spacing[0] + abs(dx) * lattice.spacing[1]
    across = [0, *(side * row for row in range(1, width + 1) for side in (-1, 1))]
    found = []
    for s, row, layer in product(range(links + 1), across, range(2)):
        x = start[0] + (end[0] - start[0]) * s / links - dy * row * cell
        y = start[1] + (end[1] - start[1]) * s / links + dx * row * cell
        if lattice.covers(x, y):
            found.append((s, *lattice.bilinear(layer, x, y)))
    return tuple(found)


def corners_in_use(weight: np.ndarray) -> list[int]:
    """Return which of the four corners of a cell have a weight at any point, from weights of shape (n, 4)."""
    # If all points lie on lines of nodes, two corners of each cell hold them.
    if not weight[:, 2:].any():
        return [0, 1]
    return [0, 2] if not weight[:, [1, 3]].any() else [0, 1, 2, 3]

"""Clamped nodes: an edge, a part of one, or a box; both layers stay where they are at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.lattice import EDGES, ROUNDING, Lattice
from ldcs_ros.schema.fields import choice, quantity


@dataclass(frozen=True, kw_only=True)
class Clamp(Effect):
    """Holds nodes of both layers at their rest positions (no degrees of freedom are left there).

    Attributes:
        edge: Which edge.
        between: The part of the edge that is held, from and to along it [m]; None for all of it.
        box: Holds the nodes of a rectangle instead, x and y of two opposite corners [m].
    """

    name: ClassVar[str] = "clamp"
    edge: str = choice("x_min", EDGES, "which edge is held", source="paper, Figure 4")
    between: tuple[float, float] | None = quantity(
        None, "m", "part of the edge that is held, from and to along it", length=2
    )
    box: tuple[float, float, float, float] | None = quantity(
        None, "m", "corners of a held rectangle, instead of an edge", length=4
    )

    def bind(self, assembly: Assembly) -> Term:
        """Return the term that holds the nodes.

        Raises:
            ValueError: No node is there.
        """
        nodes = self._nodes(assembly.lattice)
        if not nodes.size:
            place = f"box: got {list(self.box)}" if self.box is not None else f"between: got {self.between}"
            raise ValueError(f"{place} m, expected a part of the sheet with nodes in it")
        return ClampTerm(assembly, nodes)

    def _nodes(self, lattice: Lattice) -> np.ndarray:
        place, slack = lattice.reference_position, ROUNDING * max(lattice.size)
        if self.box is not None:
            low, high = np.sort(np.reshape(self.box, (2, 2)), axis=0)
            inside = np.all((place[:, :2] >= low - slack) & (place[:, :2] <= high + slack), axis=1)
            nodes = np.flatnonzero(inside)
        else:
            nodes = lattice.edge(self.edge)
            if self.between is not None:
                along = place[nodes, 0 if self.edge.startswith("y") else 1]
                nodes = nodes[(along >= min(self.between) - slack) & (along <= max(self.between) + slack)]
        return nodes[~np.isin(nodes, lattice.missing)]


class ClampTerm(Term):
    """x = rest position, v = 0."""

    name = Clamp.name

    def __init__(self, assembly: Assembly, nodes: np.ndarray) -> None:
        self.held = coordinates(nodes).ravel()
        self.value = assembly.lattice.reference_position[nodes].ravel()

    def constrained_dofs(self) -> np.ndarray:
        return self.held

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        q[self.held] = self.value
        u[self.held] = 0.0

"""A clamped edge: its nodes of both layers stay where they are at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.lattice import EDGES
from ldcs_ros.schema.fields import choice


@dataclass(frozen=True, kw_only=True)
class Clamp(Effect):
    """Holds all nodes of an edge, both layers, at their rest positions (no degrees of freedom are left there).

    Attributes:
        edge: Which edge.
    """

    name: ClassVar[str] = "clamp"
    edge: str = choice("x_min", EDGES, "which edge is held", source="paper, Figure 4")

    def bind(self, assembly: Assembly) -> Term:
        """Return the term that holds the edge."""
        return ClampTerm(assembly, self.edge)


class ClampTerm(Term):
    """x = rest position, v = 0."""

    name = Clamp.name

    def __init__(self, assembly: Assembly, edge: str) -> None:
        nodes = assembly.lattice.edge(edge)
        self.held = coordinates(nodes).ravel()
        self.value = assembly.lattice.reference_position[nodes].ravel()

    def constrained_dofs(self) -> np.ndarray:
        return self.held

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        q[self.held] = self.value
        u[self.held] = 0.0

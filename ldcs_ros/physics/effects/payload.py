"""A mass fixed to a point of the sheet: it has inertia, and weight where the scene has gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.schema.fields import REQUIRED, Location, location, quantity


@dataclass(frozen=True, kw_only=True)
class Payload(Effect):
    """A point mass, on the nodes that its point averages by their weights; gravity acts on it as on the nodes.

    Attributes:
        at: Its place: a point of the scene, [layer, i, j], or {x, y, layer} in metres.
        mass: Its mass [kg].
    """

    name: ClassVar[str] = "payload"
    at: Location = location(REQUIRED, "place of the mass")
    mass: float = quantity(REQUIRED, "kg", "mass", low=0.0, high=1e3, source="paper: 0.040 kg")

    def bind(self, assembly: Assembly) -> Term:
        """Return the term that adds the mass."""
        return PayloadTerm(assembly, self)


class PayloadTerm(Term):
    """m_i += mass times the weight of node i in the point."""

    name = Payload.name

    def __init__(self, assembly: Assembly, payload: Payload) -> None:
        point = assembly.point(payload.at)
        self.mass = np.zeros(assembly.lattice.n_nodes)
        self.mass[point.nodes] = payload.mass * point.fraction

    def added_mass(self) -> np.ndarray:
        return self.mass

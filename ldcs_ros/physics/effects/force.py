"""A constant point force with axes of ldcs_base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.schema.fields import REQUIRED, Location, location, quantity


@dataclass(frozen=True, kw_only=True)
class Force(Effect):
    """A constant force on a point, on the nodes that the point averages by their weights.

    Attributes:
        at: Its point of action: a point of the scene, [layer, i, j], or {x, y, layer} in metres.
        value: Force in ldcs_base [N].
    """

    name: ClassVar[str] = "force"
    at: Location = location(REQUIRED, "point of action")
    value: tuple[float, float, float] = quantity(
        REQUIRED, "N", "force in ldcs_base", low=-1e6, high=1e6, length=3, source="scene"
    )

    def bind(self, assembly: Assembly) -> Term:
        """Return the term of the force."""
        point = assembly.point(self.at)
        return ForceTerm(coordinates(point.nodes).ravel(), np.outer(point.fraction, self.value).ravel())


class ForceTerm(Term):
    """f = constant, V = -f . x."""

    name = Force.name

    def __init__(self, where: np.ndarray, value: np.ndarray) -> None:
        self.where, self.value = where, value

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        force[self.where] += self.value

    def energy(self, time: float, q: np.ndarray) -> float:
        return float(-self.value @ q[self.where])

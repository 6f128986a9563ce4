"""An effect of your own, without a change to the package: a tether that holds the sheet in the air by one point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.physics.effects import EFFECTS
from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.schema.fields import REQUIRED, Location, location, quantity


@dataclass(frozen=True, kw_only=True)
class Tether(Effect):
    """An elastic tether from a point to where the point began, f = -k (x - x_0) - c v.

    Attributes:
        at: The point.
        stiffness: k [N/m].
        damping: c [N s/m].
    """

    name: ClassVar[str] = "tether"
    at: Location = location(REQUIRED, "the point that is held")
    stiffness: float = quantity(100.0, "N/m", "stiffness of the tether", low=0.0, high=1e6)
    damping: float = quantity(4.0, "N s/m", "damping of the tether", low=0.0, high=1e4)

    def bind(self, assembly: Assembly) -> Term:
        """Return one spring to each node that the point averages."""
        nodes = assembly.point(self.at).nodes
        anchor = assembly.lattice.reference_position[nodes].ravel()
        return TetherTerm(
            coordinates(nodes).ravel(), anchor, self.stiffness / len(nodes), self.damping / len(nodes)
        )


class TetherTerm(Term):
    """The tether's force, energy and exact Jacobian; `where` are the coordinates that it pulls at."""

    name = Tether.name

    def __init__(self, where: np.ndarray, anchor: np.ndarray, stiffness: float, damping: float) -> None:
        self.where, self.anchor, self.stiffness, self.damping = where, anchor, stiffness, damping

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        force[self.where] -= self.stiffness * (q[self.where] - self.anchor) + self.damping * u[self.where]

    def energy(self, time: float, q: np.ndarray) -> float:
        return float(0.5 * self.stiffness * np.sum((q[self.where] - self.anchor) ** 2))

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        return self.where, self.where

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        ones = np.ones(len(self.where))
        return -self.stiffness * ones, -self.damping * ones


EFFECTS["tether"] = f"{__name__}:Tether"  # from now on scenes may name it

if __name__ == "__main__":
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.160},
        "points": {"P0": ["mid", "centre"]},
        "effects": [
            {"type": "springs", "law": "corotational", "stiffness": 80.0, "damping": 5.0},
            {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]},
            {"type": "tether", "at": "P0", "stiffness": 100.0},
        ],
    }
    simulation = load_scene(scene).build()
    simulation.advance_to(3.0)
    height = simulation.pose("P0")[0][2]
    print(f"P0 hangs {-1e3 * height:.2f} mm below its anchor; m g / k = {1e3 * 0.160 * 9.81 / 100.0:.2f} mm")

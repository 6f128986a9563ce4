"""Uniform gravity on everything that has mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.schema.fields import quantity


@dataclass(frozen=True, kw_only=True)
class Gravity(Effect):
    """Uniform gravity, f_i = m_i g, on the nodes with their payloads; the arms' links feel the same g.

    Attributes:
        acceleration: Gravitational acceleration in ldcs_base [m/s^2].
    """

    name: ClassVar[str] = "gravity"
    acceleration: tuple[float, float, float] = quantity(
        (0.0, 0.0, -9.81),
        "m/s^2",
        "acceleration in ldcs_base",
        low=-1e3,
        high=1e3,
        length=3,
        source="paper: 40 g weigh 0.39 N",
    )

    def bind(self, assembly: Assembly) -> Term:
        """Return the weight of the nodes, as constant forces."""
        return GravityTerm(assembly, np.array(self.acceleration))


class GravityTerm(Term):
    """f = m g, V = -m g . x."""

    name = Gravity.name

    def __init__(self, assembly: Assembly, acceleration: np.ndarray) -> None:
        self.weight = (assembly.node_mass[:, None] * acceleration).ravel()

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        force[: self.weight.size] += self.weight

    def energy(self, time: float, q: np.ndarray) -> float:
        return float(-self.weight @ q[: self.weight.size])

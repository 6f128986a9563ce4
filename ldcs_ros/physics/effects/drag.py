"""Air drag on the moving sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.schema.fields import quantity


@dataclass(frozen=True, kw_only=True)
class Drag(Effect):
    """Quadratic drag, f_i = -1/2 rho C_d A_i |v_i| v_i, A_i half of its part of a layer's area.

    Attributes:
        density: Density of the medium rho [kg/m^3].
        coefficient: Drag coefficient C_d of a plate.
    """

    name: ClassVar[str] = "drag"
    density: float = quantity(1.2, "kg/m^3", "density of the medium", low=0.0, high=2e4, source="air at 20 C")
    coefficient: float = quantity(
        1.2, "", "drag coefficient", low=0.0, high=100.0, source="flat plate across the flow"
    )

    def bind(self, assembly: Assembly) -> Term:
        """Return the drag of all nodes."""
        scale = 0.5 * self.density * self.coefficient * 0.5 * assembly.lattice.node_area
        return DragTerm(scale)


class DragTerm(Term):
    """f = -s |v| v for each node."""

    name = Drag.name

    def __init__(self, scale: np.ndarray) -> None:
        self.scale = scale
        self.count = len(scale)

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        v = u[: 3 * self.count].reshape(-1, 3)
        speed = np.sqrt(np.einsum("ij,ij->i", v, v))
        force[: 3 * self.count] -= ((self.scale * speed)[:, None] * v).ravel()

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        place = coordinates(np.arange(self.count))
        rows, columns = np.broadcast_arrays(place[:, :, None], place[:, None, :])
        return rows.ravel(), columns.ravel()

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        v = u[: 3 * self.count].reshape(-1, 3)
        speed = np.sqrt(np.einsum("ij,ij->i", v, v))
        axis = v / np.where(speed > 0.0, speed, 1.0)[:, None]
        by_rate = -(self.scale * speed)[:, None, None] * (np.eye(3) + axis[:, :, None] * axis[:, None, :])
        return np.zeros(by_rate.size), by_rate.ravel()

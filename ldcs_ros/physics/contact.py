"""Unilateral contact of nodes with a horizontal plane: smooth beginning, never pulls."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.effects.base import Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands


class PlaneContact(Term):
    """Nodes on a plane z = height, as in Hunt and Crossley (1975), with a linear law and a rounded corner.

    f_z = E'(d) max(0, 1 + beta d'), d = height - z the penetration. E'(d) is 0 for d < 0, k d^2 / (2 w) up to
    the contact width w and k (d - w / 2) beyond. It is once continuously differentiable, so Newton's method and
    error control see no corner. The dissipation E'(d) beta d'^2 is never negative, and the force is never below
    zero.
    """

    def __init__(
        self,
        name: str,
        nodes: np.ndarray,
        *,
        height: float,
        stiffness: float,
        damping: float,
        contact_width: float,
    ) -> None:
        self.name = name
        self.vertical = coordinates(nodes)[:, 2]
        self.height, self.stiffness, self.damping, self.contact_width = (
            height,
            stiffness,
            damping,
            contact_width,
        )

    def _normal(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        depth = self.height - q[self.vertical]
        push = self.stiffness * np.where(
            depth < self.contact_width,
            np.maximum(depth, 0.0) ** 2 / (2.0 * self.contact_width),
            depth - 0.5 * self.contact_width,
        )
        slope = self.stiffness * np.clip(depth / self.contact_width, 0.0, 1.0)
        return push, slope

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        push, _ = self._normal(q)
        if push.any():
            force[self.vertical] += push * np.maximum(0.0, 1.0 - self.damping * u[self.vertical])

    def energy(self, time: float, q: np.ndarray) -> float:
        depth, w = self.height - q[self.vertical], self.contact_width
        rounded = np.maximum(depth, 0.0) ** 3 / (6.0 * w)
        beyond = 0.5 * depth**2 - 0.5 * w * depth + w * w / 6.0
        return float(self.stiffness * np.sum(np.where(depth < w, rounded, beyond)))

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        return self.vertical, self.vertical

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        push, slope = self._normal(q)
        fraction = 1.0 - self.damping * u[self.vertical]
        return -slope * np.maximum(fraction, 0.0), np.where(fraction > 0.0, -self.damping * push, 0.0)

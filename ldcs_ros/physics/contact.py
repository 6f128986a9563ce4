"""Unilateral contact of nodes with a horizontal plane: smooth onset, never pulls."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.effects.base import Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands


class PlaneContact(Term):
    """Nodes on a plane z = height, as in Hunt and Crossley (1975), with a linear law and a rounded onset.

    f_z = E'(d) max(0, 1 + beta d'), d = height - z the penetration. E'(d) is 0 for d < 0, k d^2 / (2 w) up to
    the onset width w and k (d - w / 2) beyond: once continuously differentiable, so Newton's method and error
    control see no corner. The dissipation E'(d) beta d'^2 is never negative, and the force is never below
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
        onset: float,
    ) -> None:
        self.name = name
        self.vertical = coordinates(nodes)[:, 2]
        self.height, self.stiffness, self.damping, self.onset = height, stiffness, damping, onset

    def _normal(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        depth = self.height - q[self.vertical]
        push = self.stiffness * np.where(
            depth < self.onset, np.maximum(depth, 0.0) ** 2 / (2.0 * self.onset), depth - 0.5 * self.onset
        )
        slope = self.stiffness * np.clip(depth / self.onset, 0.0, 1.0)
        return push, slope

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        push, _ = self._normal(q)
        if push.any():
            force[self.vertical] += push * np.maximum(0.0, 1.0 - self.damping * u[self.vertical])

    def energy(self, time: float, q: np.ndarray) -> float:
        depth, w = self.height - q[self.vertical], self.onset
        rounded = np.maximum(depth, 0.0) ** 3 / (6.0 * w)
        beyond = 0.5 * depth**2 - 0.5 * w * depth + w * w / 6.0
        return float(self.stiffness * np.sum(np.where(depth < w, rounded, beyond)))

    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        return self.vertical, self.vertical

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        push, slope = self._normal(q)
        share = 1.0 - self.damping * u[self.vertical]
        return -slope * np.maximum(share, 0.0), np.where(share > 0.0, -self.damping * push, 0.0)

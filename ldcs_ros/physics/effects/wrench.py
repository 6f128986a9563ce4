"""Forces and torques that are commanded while the simulation runs, at frames that move with the sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands, Wrench
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.schema.fields import quantity

ALIGNED = "_aligned"


@dataclass(frozen=True, kw_only=True)
class WrenchInput(Effect):
    """Accepts wrenches from the topic `external_wrench`, from schedules and from Python.

    A frame is a point's name (`P0`, `node_top_8_4`): its origin and axes move and rotate with the sheet. The same
    name with `_aligned` has that origin and the axes of ldcs_base. The force acts in equal parts on the point's
    nodes. The torque becomes the least forces of zero sum on the nodes around it.

    Attributes:
        force_limit: Largest magnitude of a force [N]; above it a command is refused.
        torque_limit: Largest magnitude of a torque [N m].
    """

    name: ClassVar[str] = "wrench"
    force_limit: float = quantity(100.0, "N", "largest accepted force", low=0.0, high=1e9)
    torque_limit: float = quantity(10.0, "N m", "largest accepted torque", low=0.0, high=1e9)

    def bind(self, assembly: Assembly) -> Term:
        """Return the term that applies the commanded wrenches."""
        return WrenchTerm(assembly, self)


class WrenchTerm(Term):
    """Sum of the held wrenches; their work is an input, so there is no energy.

    The Jacobian omits the rotation of a wrench with its frame. At 1 N that is about 1 N over 20 mm against springs
    of 80 N/m each. A Newton iteration with the exact force still converges to the exact answer; derivatives add
    `position_slope`.
    """

    name = WrenchInput.name
    commanded = True
    has_energy = False

    def __init__(self, assembly: Assembly, effect: WrenchInput) -> None:
        self.effect = effect
        self._lattice, self._points = assembly.lattice, assembly.points
        self._known: dict[str, tuple[Point, bool]] = {}

    def frame(self, name: str) -> tuple[Point, bool]:
        """Return the point of a frame and whether its axes are those of ldcs_base; ValueError if there is none."""
        if name not in self._known:
            aligned = name.endswith(ALIGNED)
            self._known[name] = (point_at(self._lattice, name.removesuffix(ALIGNED), self._points), aligned)
        return self._known[name]

    def in_base(self, name: str, wrench: Wrench, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and torque [N m] in ldcs_base, shape (3,) each; node positions [m], shape (n_nodes, 3)."""
        point, aligned = self.frame(name)
        axes = np.eye(3) if aligned else point.frame(position)
        return axes @ np.array(wrench.force), axes @ np.array(wrench.torque)

    def position_slope(self, q: np.ndarray, inputs: HeldCommands) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates that the forces turn with, shape (n,), and d(force)/d(these), shape (n_coordinates, n).

        Central differences over a ten-thousandth of the least edge of the sheet have an error of 1e-7 of it.
        """
        around: list[np.ndarray] = []
        for name, wrench in inputs.wrenches.items():
            point, aligned = self.frame(name)
            if any(wrench.torque) or (any(wrench.force) and not aligned):
                around += [
                    point.patch,
                    *(one.nodes for one in (point.behind, point.ahead, point.right, point.left)),
                ]
        nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *around]))
        columns = coordinates(nodes).ravel()
        step = 1e-4 * min(self._lattice.size)
        slope = np.zeros((len(q), len(columns)))
        for k, column in enumerate(columns):
            for sign in (1.0, -1.0):
                there, force = q.copy(), np.zeros_like(q)
                there[column] += sign * step
                self.add_force(0.0, there, 0.0 * q, inputs, force)
                slope[:, k] += sign * force / (2.0 * step)
        return columns, slope

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        if not inputs.wrenches:
            return
        position = q[: 3 * self._lattice.n_nodes].reshape(-1, 3)
        for name, wrench in inputs.wrenches.items():
            point, _ = self.frame(name)
            push, torque = self.in_base(name, wrench, position)
            force[coordinates(point.nodes)] += np.outer(point.fraction, push)
            if torque.any():
                patch, pushes = point.moment_as_nodal_forces(position, torque)
                force[coordinates(patch)] += pushes

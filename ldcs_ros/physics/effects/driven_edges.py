"""Side edges driven exactly onto an arc, without arms: the benchmark's actuation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.curves import fill_arc, smoothstep
from ldcs_ros.physics.effects.base import Assembly, Effect, Term, coordinates
from ldcs_ros.schema.fields import REQUIRED, choices, quantity


@dataclass(frozen=True, kw_only=True)
class DrivenEdges(Effect):
    """Prescribes both layers of the side edges to an arc of curvature kappa(t) = s(t) curvature in the XZ plane.

    The mid-plane of the edge lies on the arc and keeps its length along x. The layers are offset along the local
    normal. s(t) is the smoothstep s = 3 u^2 - 2 u^3, u = t / rise_time, from t = 0.

    Attributes:
        edges: Which side edges.
        curvature: Final curvature [1/m], positive bends up.
        rise_time: Duration of the rise [s].
    """

    name: ClassVar[str] = "driven_edges"
    edges: tuple[str, ...] = choices(("y_min", "y_max"), ("y_min", "y_max"), "which side edges")
    curvature: float = quantity(
        REQUIRED, "1/m", "final curvature", low=-1e3, high=1e3, source="paper: r = 0.115 m"
    )
    rise_time: float = quantity(1.0, "s", "duration of the smooth rise", low=1e-6, high=1e6)

    def bind(self, assembly: Assembly) -> Term:
        """Return the term that prescribes the edges."""
        return DrivenEdgesTerm(assembly, self)


class DrivenEdgesTerm(Term):
    """x(t) and v(t) of the driven nodes."""

    name = DrivenEdges.name

    def __init__(self, assembly: Assembly, effect: DrivenEdges) -> None:
        nodes = np.concatenate([assembly.lattice.edge(edge) for edge in effect.edges])
        self.driven = coordinates(nodes)
        self.rest = tuple(np.ascontiguousarray(axis) for axis in assembly.lattice.reference_position[nodes].T)
        self._place, self._rate = np.empty((len(nodes), 3)), np.empty((len(nodes), 3))
        self.curvature, self.rise_time = effect.curvature, effect.rise_time
        self.breakpoints = (0.0, effect.rise_time)

    def constrained_dofs(self) -> np.ndarray:
        return self.driven.ravel()

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        fraction, fraction_rate = smoothstep(time / self.rise_time)
        kappa = fraction * self.curvature
        kappa_rate = fraction_rate * self.curvature / self.rise_time
        along, across, height = self.rest
        fill_arc(along, across, height, kappa, kappa_rate, self._place, self._rate)
        q[self.driven] = self._place
        u[self.driven] = self._rate

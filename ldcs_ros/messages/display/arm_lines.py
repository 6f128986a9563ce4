"""The arms for viewers: the links of a chain with its joints, or the arc that an edge is driven onto."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.marker import CYLINDER, LINE_STRIP, SPHERE_LIST, MarkerSpec
from ldcs_ros.physics.effects.arms import Arms, ArmsTerm
from ldcs_ros.physics.effects.base import Assembly, Effect
from ldcs_ros.physics.effects.driven_edges import DrivenEdges
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point

_WIDTH = 1.3  # of a link, in thicknesses of the sheet: an arm shows above and below it
_EDGE = 0.6  # of a driven edge, likewise
_JOINT = 1.6  # diameter of a joint, likewise


class ArmLines:
    """A drawing of the arms: the links as cylinders with a ball at each joint, driven edges as lines.

    Args:
        lattice: The lattice.
        points: The scene's named points.
        effects: The scene's effects; arms and driven edges are drawn.
    """

    def __init__(self, lattice: Lattice, points: dict[str, Point], effects: Iterable[Effect]) -> None:
        self._lattice = lattice
        self._thickness = float(lattice.size[2])
        self._term: ArmsTerm | None = None
        self._edges: list[tuple[str, np.ndarray]] = []
        for effect in effects:
            if isinstance(effect, Arms):
                self._term = ArmsTerm(Assembly(lattice, points, lattice.node_mass), effect)
            elif isinstance(effect, DrivenEdges):
                self._edges = [(edge, _middle(lattice, edge)) for edge in effect.edges]

    def lines(self, position: np.ndarray, link_angle: np.ndarray) -> dict[str, np.ndarray]:
        """Return the points of each line [m], shape (n, 3), by name: base, ends of the links; or along the edge.

        Args:
            position: Node positions [m], shape (n_nodes, 3).
            link_angle: Angles of the links to their arms' lines [rad], shape (n_arms, n_links).
        """
        drawn = {edge: position[nodes].mean(axis=0) for edge, nodes in self._edges}
        if self._term is not None and np.size(link_angle):
            stations = self._term.station_positions(np.concatenate([position.ravel(), np.ravel(link_angle)]))
            for name, line, links in zip(self._term.names, stations, self._term.links, strict=True):
                drawn[name] = line[: links + 1]
        return drawn

    def specs(self, position: np.ndarray, link_angle: np.ndarray) -> list[MarkerSpec]:
        """Return what is drawn for what `lines` takes, with its shapes."""
        width = _WIDTH * self._thickness
        drawn = []
        for name, points in self.lines(position, link_angle).items():
            if self._term is not None and name in self._term.names:
                pairs = itertools.pairwise(points)
                drawn += [_link(f"{name}/link_{k + 1}", *ends, width) for k, ends in enumerate(pairs)]
                scale = (_JOINT * self._thickness,) * 3
                drawn.append(
                    MarkerSpec(f"{name}/joints", SPHERE_LIST, scale, colours.JOINT, points=points[:-1])
                )
            else:
                thin = (_EDGE * self._thickness, 0.0, 0.0)
                drawn.append(MarkerSpec(name, LINE_STRIP, thin, colours.ARM, points=points))
        return drawn


def _link(name: str, start: np.ndarray, end: np.ndarray, width: float) -> MarkerSpec:
    """Return a cylinder from one point to another [m]."""
    x, y, z = end - start
    flat = float(np.hypot(x, y))
    # The rotation about z x link takes z to the link; a vertical one turns about y.
    half = 0.5 * np.arctan2(flat, z)
    axis = (-y / flat, x / flat) if flat > 0.0 else (0.0, 1.0)
    scale = (width, width, float(np.hypot(flat, z)))
    turn = (float(axis[0] * np.sin(half)), float(axis[1] * np.sin(half)), 0.0, float(np.cos(half)))
    return MarkerSpec(name, CYLINDER, scale, colours.ARM, position=0.5 * (start + end), orientation=turn)


def _middle(lattice: Lattice, edge: str) -> np.ndarray:
    """Return the nodes of both layers along a side edge, shape (2, nx)."""
    return lattice.index[:, :, 0 if edge == "y_min" else -1]

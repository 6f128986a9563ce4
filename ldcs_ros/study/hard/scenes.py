"""Scenes of the hard cases as plain dicts, the one way to change them, and invalid shapes to start from."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.schema.paths import with_values

Content = dict[str, Any]

SHEET: Content = {"size": [0.140, 0.140, 0.010], "nodes": [5, 4], "mass": 0.160}
POINTS: Content = {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]}

HANGING: Content = {
    "lattice": SHEET,
    "points": POINTS,
    "effects": [{"type": "springs"}, {"type": "gravity"}, {"type": "clamp"}],
}
FREE: Content = {"lattice": SHEET, "points": POINTS, "effects": [{"type": "springs"}, {"type": "wrench"}]}
ARC: Content = {
    "lattice": SHEET,
    "points": POINTS,
    "effects": [
        {"type": "springs"},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "force", "at": "P1", "value": [0.0, 0.0, -0.39]},
        {"type": "driven_edges", "curvature": 8.695652173913043},
    ],
}
ARMS: Content = {
    "lattice": SHEET,
    "points": POINTS,
    "effects": [
        {"type": "springs"},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "payload", "at": "P1", "mass": 0.040},
        {"type": "arms", "width": 1},
        {"type": "wrench"},
    ],
    "inputs": [{"time": 0.0, "torque": 0.1392}],
}
RIG: Content = {
    "lattice": SHEET,
    "points": POINTS,
    "effects": [
        {"type": "springs"},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "payload", "at": "P1", "mass": 0.040},
        {"type": "arms", "width": 1, "drive": "pressure"},
        {"type": "support"},
    ],
    "inputs": [{"time": 0.0, "pressure": 140.0e3}],
}
FALLING: Content = {
    "lattice": SHEET,
    "points": POINTS,
    "effects": [{"type": "springs"}, {"type": "gravity"}, {"type": "floor", "height": -0.205}],
}


def changed(scene: Content, values: Content | None = None, *, add: tuple[Content, ...] = ()) -> Content:
    """Return a copy of a scene with values put at paths (`effects.springs.stiffness`) and effects added."""
    result = with_values(scene, values or {})
    result["effects"] += copy.deepcopy(list(add))
    return result


def inverted(lattice: Lattice) -> np.ndarray:
    """Return the sheet with top and bottom exchanged; shape (n_nodes, 3) [m], as all starts."""
    return lattice.reference_position * [1.0, 1.0, -1.0]


def turned_over(lattice: Lattice) -> np.ndarray:
    """Return the sheet after half a turn about the x axis; shape (n_nodes, 3) [m]."""
    return lattice.reference_position * [1.0, -1.0, -1.0]


def crumpled(lattice: Lattice) -> np.ndarray:
    """Return the sheet with each coordinate moved by up to half a spacing at random; shape (n_nodes, 3) [m]."""
    random = np.random.default_rng(4)
    reach = 0.5 * np.array([*lattice.spacing, min(lattice.spacing)])
    return lattice.reference_position + random.uniform(-1.0, 1.0, (lattice.n_nodes, 3)) * reach


def ruffled(lattice: Lattice) -> np.ndarray:
    """Return the sheet with each coordinate moved by up to a tenth of its spacing at random."""
    random = np.random.default_rng(5)
    reach = 0.1 * np.array([*lattice.spacing, lattice.size[2]])
    return lattice.reference_position + random.uniform(-1.0, 1.0, (lattice.n_nodes, 3)) * reach


def two_coincident(lattice: Lattice) -> np.ndarray:
    """Return the sheet with two neighbours of the top layer at one place; shape (n_nodes, 3) [m]."""
    position = lattice.reference_position.copy()
    nx, ny = lattice.nodes
    position[lattice.node("top", nx // 2, ny // 2)] = position[lattice.node("top", nx // 2 - 1, ny // 2)]
    return position


def in_plane(lattice: Lattice) -> np.ndarray:
    """Return the sheet with all nodes in the plane z = 0, each on its partner of the other layer."""
    return lattice.reference_position * [1.0, 1.0, 0.0]


def on_line(lattice: Lattice) -> np.ndarray:
    """Return the sheet with all nodes on the x axis; shape (n_nodes, 3) [m]."""
    return lattice.reference_position * [1.0, 0.0, 0.0]


def in_one_point(lattice: Lattice) -> np.ndarray:
    """Return all nodes in one point; shape (n_nodes, 3) [m]."""
    return np.tile([0.5 * lattice.size[0], 0.0, 0.0], (lattice.n_nodes, 1))


def rolled_up(lattice: Lattice) -> np.ndarray:
    """Return the sheet rolled one and a half times around the y axis, at its own length; shape (n_nodes, 3) [m]."""
    x, y, z = lattice.reference_position.T
    kappa = 3.0 * np.pi / lattice.size[0]
    return np.stack(
        [(1 / kappa - z) * np.sin(kappa * x), y, 1 / kappa - (1 / kappa - z) * np.cos(kappa * x)], 1
    )


# Each returns node positions [m], shape (n_nodes, 3).
STARTS: dict[str, Callable[[Lattice], np.ndarray]] = {
    start.__name__: start
    for start in (
        inverted,
        turned_over,
        crumpled,
        ruffled,
        two_coincident,
        in_plane,
        on_line,
        in_one_point,
        rolled_up,
    )
}

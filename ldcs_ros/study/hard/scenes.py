"""The scenes that hard cases are made of, as plain dicts, and the one way to change them."""

from __future__ import annotations

import copy
from typing import Any

from ldcs_ros.schema.paths import with_values

Content = dict[str, Any]

SHEET: Content = {"size": [0.140, 0.140, 0.010], "nodes": [9, 9], "mass": 0.160}
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

"""A small sheet on pneumatic arms."""

from __future__ import annotations

SCENE = {
    "title": "A small sheet that is lifted and let down",
    "lattice": {"size": [0.140, 0.140, 0.010], "nodes": [5, 5], "mass": 0.160},
    "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp", "edge": "x_min"},
        {"type": "arms", "drive": "pressure"},
    ],
    "sensors": {"tracker": {"points": ["P0", "P1"], "rate": 80.0}, "pressure": {"rate": 100.0}},
    "solver": {"integrator": "auto", "accuracy": 1.0e-4},
}

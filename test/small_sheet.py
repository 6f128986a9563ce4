"""The small scene of many tests: a clamped square sheet on two arms."""

from __future__ import annotations


def small_sheet(*effects, nodes=(5, 5), arms=None, **more):
    """Return a scene with P0 in the middle, P1 at the free edge; further effects, keys of arms, keys of the scene."""
    return {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": list(nodes), "mass": 0.16},
        "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
        "effects": [
            {"type": "springs", "stiffness": 80.0, "damping": 5.0},
            {"type": "gravity"},
            {"type": "clamp", "edge": "x_min"},
            {"type": "arms", "drive": "pressure", **(arms or {})},
            *effects,
        ],
        "sensors": {"tracker": {"points": ["P0", "P1"], "rate": 80.0}, "pressure": {"rate": 100.0}},
        "solver": {"integrator": "auto", "accuracy": 1.0e-4},
        **more,
    }

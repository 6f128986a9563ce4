"""Cases that try the error control: violent drives, contact from the start, free flight, buckling, steady commands."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.study.accuracy.random_scenes import Case

POINTS = {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]}
CLAMP = {"type": "clamp", "edge": "x_min"}


def violent_cases() -> list[Case]:
    """Return all of them."""
    cases = []
    for rise in (1e-6, 1e-4, 1e-3, 1e-2):
        drive = {"type": "driven_edges", "curvature": 8.0, "rise_time": rise}
        cases.append(Case(f"driven_edges_rise_{rise:g}_s", _content([4, 3], drive), 0.5))
        arms = {"type": "arms", "drive": "curvature", "curvature": 6.0, "rise_time": rise, "links": 3}
        cases.append(Case(f"arms_rise_{rise:g}_s", _content([4, 3], CLAMP, arms), 0.5))
    for depth in (1e-4, 2e-3):
        floor = {"type": "floor", "height": -0.0035 + depth}
        cases.append(Case(f"starts_{depth:g}_m_inside_the_floor", _content([4, 3], CLAMP, floor), 0.5))
    floor = {"type": "floor", "height": -0.01, "stiffness": 5e3}
    cases.append(Case("falls_on_a_floor", _content([3, 3], floor), 0.5, drift=(0.0, 0.0, -0.5)))
    push = {"frame": "P1_aligned", "force": [0.0, 0.0, 50.0]}
    pulse = [{"time": 0.1, "wrench": push}, {"time": 0.100001, "wrench": push | {"force": [0.0, 0.0, 0.0]}}]
    cases.append(Case("pulse_of_1_us", _content([4, 3], CLAMP, {"type": "wrench"}) | {"inputs": pulse}, 0.5))
    for duration in (10.0, 60.0, 120.0):
        free = _content([3, 3], damping=0.05, gravity=False)
        cases.append(
            Case(f"free_flight_{duration:g}_s", free, duration, spin=(0.4, 0.3, 1.0), drift=(0.1, 0.0, 0.05))
        )
    for rate, name in ((100, "100_hz"), (1000, "1_khz")):
        rng = np.random.default_rng(rate)
        inputs = [
            {
                "time": k / rate,
                "torque": [float(0.05 + 0.04 * np.sin(6.0 * k / rate) + 2e-4 * w) for w in pair],
            }
            for k, pair in enumerate(rng.normal(size=(int(0.5 * rate), 2)))
        ]
        arms = {"type": "arms", "drive": "torque", "links": 3}
        cases.append(Case(f"torques_at_{name}", _content([4, 3], CLAMP, arms) | {"inputs": inputs}, 0.5))
    return cases


def _content(
    nodes: list[int], *effects: dict[str, Any], damping: float = 1.0, gravity: bool = True
) -> dict[str, Any]:
    springs = {"type": "springs", "law": "axial", "stiffness": 300.0, "damping": damping}
    weight = [{"type": "gravity"}] if gravity else []
    return {
        "lattice": {"size": [0.14, 0.14, 0.007], "nodes": nodes, "mass": 0.1},
        "points": POINTS,
        "effects": [springs, *weight, *effects],
    }

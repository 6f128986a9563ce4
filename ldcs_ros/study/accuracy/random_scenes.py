"""Random scenes over the whole schema, small and short enough for an independent reference; a seed makes one scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

Option = TypeVar("Option")


@dataclass(frozen=True)
class Case:
    """A scene to measure.

    Attributes:
        name: Its name.
        content: Its scene, as a mapping.
        duration: Simulated time [s].
        spin: Angular velocity of the whole sheet at the start [rad/s], shape (3,).
        drift: Linear velocity of the whole sheet at the start [m/s], shape (3,).
        looks: Comparisons in its duration.
        start: Place of each node at the start [m], in the order of nodes; empty for the flat sheet.
    """

    name: str
    content: dict[str, Any]
    duration: float
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    looks: int = 100
    start: tuple[tuple[float, ...], ...] = ()


def random_case(seed: int) -> Case:
    """Return the random scene of a seed."""
    rng = np.random.default_rng([20, seed])

    def chance(probability: float) -> bool:
        return bool(rng.random() < probability)

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def decades(low: float, high: float) -> float:
        return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))

    def pick(*options: Option) -> Option:
        return options[int(rng.integers(len(options)))]

    nodes = [int(rng.integers(2, 6)), int(rng.integers(2, 5))]
    size = [pick(0.05, 0.14, 0.3), pick(0.05, 0.14), pick(0.005, 0.01, 0.02)]
    damping = 0.0 if chance(0.1) else decades(0.02, 5.0)
    springs = {
        "type": "springs",
        "law": pick("axial", "axial", "axiswise", "corotational"),
        "stiffness": decades(20.0, 2e4),
        "damping": damping,
    }
    effects: list[dict[str, Any]] = [springs]
    if chance(0.8):
        effects.append({"type": "gravity", "acceleration": [0.0, 0.0, pick(-9.81, -9.81, -1.62, -30.0)]})
    hold = pick("clamp", "clamp", "clamp", "driven", "free")
    if hold == "clamp":
        effects.append({"type": "clamp", "edge": pick("x_min", "x_min", "y_max")})
    if hold == "driven":
        effects.append(
            {
                "type": "driven_edges",
                "edges": pick(["y_max"], ["y_min", "y_max"] if nodes[1] > 2 else ["y_min"]),
                "curvature": between(-12.0, 12.0),
                "rise_time": decades(1e-3, 0.5),
            }
        )
    if chance(0.4):
        effects.append({"type": "payload", "at": pick("P1", "P0"), "mass": decades(0.003, 0.3)})
    if chance(0.25):
        push = [between(-0.3, 0.3) for _ in range(3)]
        effects.append({"type": "force", "at": pick("P1", ["top", 1, 0]), "value": push})
    if chance(0.3):
        effects.append({"type": "drag", "density": pick(1.2, 1000.0), "coefficient": 1.2})
    if chance(0.25):
        effects.append(
            {
                "type": "floor",
                "height": -0.5 * size[2] - pick(0.0, 0.005, 0.02),
                "stiffness": decades(100.0, 1e4),
                "damping": pick(0.0, 1.0, 10.0),
            }
        )
    elif hold == "clamp" and chance(0.2):
        effects.append({"type": "support"})
    duration = pick(0.3, 0.6, 1.0)
    drive = None
    if hold == "clamp" and effects[-1]["type"] != "driven_edges" and chance(0.5):
        drive = pick("torque", "pressure", "curvature")
        links = int(rng.integers(1, 8))
        arms = {
            "type": "arms",
            "drive": drive,
            "links": links,
            "link_mass": pick(0.005, 0.02, 0.001),
            "joint_stiffness": decades(0.03, 1.0),
            "joint_damping": decades(5e-4, 0.05),
            "coupling_stiffness": decades(500.0, 2e4),
            "coupling_damping": decades(5.0, 500.0),
            "crosspiece": pick("link", "bisector"),
            "base_joint_share": pick(0.5, 1.0),
            "width": int(rng.integers(0, 2)),
            "backbone_height": pick(0.0, 0.0015),
        }
        if drive == "curvature":
            arms |= {"curvature": between(-8.0, 8.0), "rise_time": decades(1e-2, 0.5)}
        if drive == "pressure":
            arms |= {"pressure_gain": 5e-7, "fill_time": pick(0.05, 0.2), "dead_time": pick(0.0, 0.013)}
        effects.append(arms)
    wrench = chance(0.3)
    if wrench:
        effects.append({"type": "wrench"})
    inputs = []
    if drive in ("torque", "pressure") or wrench:
        for time in sorted(between(0.0, duration) for _ in range(int(rng.integers(1, 6)))):
            command: dict[str, Any] = {"time": round(time, 6)}
            if drive == "torque":
                command["torque"] = [between(-0.05, 0.15), between(-0.05, 0.15)]
            if drive == "pressure":
                command["pressure"] = [between(0.0, 1.5e5), between(0.0, 1.5e5)]
            if wrench:
                command["wrench"] = {
                    "frame": pick("P1", "P1_aligned", "P0", "node_top_1_1_aligned"),
                    "force": [between(-0.2, 0.2) for _ in range(3)],
                    "torque": [between(-0.005, 0.005) for _ in range(3)] if chance(0.5) else [0.0] * 3,
                }
            inputs.append(command)
    spin = drift = (0.0, 0.0, 0.0)
    if hold == "free" or chance(0.1):
        spin = (between(-6.0, 6.0), between(-6.0, 6.0), between(-6.0, 6.0))
        drift = (between(-0.5, 0.5), between(-0.5, 0.5), between(-0.5, 0.5))
    content = {
        "lattice": {"size": size, "nodes": nodes, "mass": decades(0.01, 0.3)},
        "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
        "effects": effects,
    }
    if inputs:
        content["inputs"] = inputs
    return Case(f"random_{seed}", content, duration, spin, drift)

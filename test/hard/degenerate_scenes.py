"""Scenes near degeneracy: thin and tiny sheets, holes that leave strips, arms on an edge or on each other."""

from __future__ import annotations

from typing import Any

import numpy as np


def degenerate_scene(seed: int) -> dict[str, Any]:
    """Return the scene of a seed; about four in five are refused."""
    rng = np.random.default_rng([7, seed])

    def pick(*options: Any) -> Any:
        return options[int(rng.integers(len(options)))]

    def chance(probability: float) -> bool:
        return bool(rng.random() < probability)

    length, width, thickness = pick(0.14, 0.14, 1e-3, 1e-5), pick(0.14, 0.05, 1e-5), pick(0.01, 1e-4, 1e-6)
    nx, ny = int(rng.integers(2, 8)), int(rng.integers(2, 8))

    def place() -> list[float]:
        x = pick(0.0, length / 2, length, float(rng.uniform(-0.02, 1.02)) * length)
        return [x, pick(-width / 2, 0.0, width / 2, float(rng.uniform(-0.52, 0.52)) * width)]

    def shape() -> dict[str, Any]:
        kind = pick("box", "circle", "polygon")
        if kind == "circle":
            return {"circle": [*place(), pick(0.0, 1e-12, 1e-6, length / 6, length / 3, 10.0 * length)]}
        if kind == "polygon":
            corners = [place() for _ in range(int(rng.integers(2, 6)))]
            return {"polygon": pick(corners, 3 * corners[:1], [[0.0, 0.0], [length / 2, 0.0], [length, 0.0]])}
        one, other = place(), place()
        if chance(0.4):
            other[0] = one[0] + pick(0.0, 1e-12)
        if chance(0.2):
            one[1], other[1] = -width, width
        return {"box": [*one, *other]}

    lattice: dict[str, Any] = {"size": [length, width, thickness], "nodes": [nx, ny]}
    if chance(0.6):
        lattice["holes"] = [shape() for _ in range(int(rng.integers(1, 4)))]
    if chance(0.3):
        factor = {pick("stiffness", "damping", "mass", "thickness"): pick(1e-6, 1e6)}
        lattice["regions"] = [{**shape(), **factor}]
    content: dict[str, Any] = {"lattice": lattice}
    effects: list[dict[str, Any]] = [{"type": "springs"}, {"type": "gravity"}]
    if chance(0.4):
        poisson = pick(0.5, 0.4999999, 0.0, 1 / 3)
        content["material"] = {"youngs_modulus": pick(75e3, 1e9, 1.0), "poisson": poisson, "density": 816.0}
    else:
        lattice["mass"] = pick(0.1, 1e-9, 1e3)
        effects[0] |= {"law": pick("axial", "axiswise", "corotational"), "damping": pick(0.0, 1.0, 1e3)}
    hold = pick("edge", "box", "part", "driven", "none")
    clamps = {
        "edge": {"type": "clamp"},
        "box": {"type": "clamp", "box": [*place(), *place()]},
        "part": {"type": "clamp", "edge": "x_min", "between": sorted([place()[1], place()[1]])},
        "driven": {"type": "driven_edges", "curvature": pick(0.0, 1e3, 1e-12), "rise_time": 1e-6},
    }  # fmt: skip
    effects += [clamps[hold]] if hold in clamps else []
    if chance(0.3):
        effects.append({"type": "floor", "height": pick(-thickness / 2, 0.0), "stiffness": pick(1e6, 1e3)})
    if chance(0.5) and hold != "driven":
        lines = [{"name": f"a{k}", "from": place(), "to": place()} for k in range(int(rng.integers(1, 4)))]
        if chance(0.4):
            lines.append({**lines[0], "name": "twin"})
        if chance(0.2):
            lines[0]["to"] = pick(lines[0]["from"], [lines[0]["from"][0] + 1e-9, lines[0]["from"][1]])
        effects.append({"type": "arms", "links": pick(1, 2, 64), "width": pick(0, 1, 6), "arms": lines})
    if chance(0.5):
        effects.append({"type": "wrench"})
        frame = pick("node_top_0_0", f"node_bottom_{nx - 1}_{ny - 1}", "centre", "free_edge") + pick(
            "", "_aligned"
        )
        push = {"frame": frame, "force": [0.0, 0.0, pick(0.0, 10.0)], "torque": [pick(0.0, 1.0), 0.0, 1e-3]}
        content["inputs"] = [{"time": 0.0, "wrench": push}]
    return content | {"effects": effects}

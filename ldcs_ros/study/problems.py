"""What the studies solve: shipped scenes with another lattice, law or solver, and when their error is taken."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation

# Times at which node positions are compared [s]; the last one ends a run.
ERROR_TIMES = (0.5, 1.0, 2.0, 3.0)
# Scenes with another spring law than the shipped one.
WITH_LAW = {"arc_axiswise": ("arc", "axiswise")}


def content_of(name: str, nodes: int | None = None) -> dict[str, Any]:
    """Return the content of a problem's scene, with nodes x nodes nodes if a number is given."""
    from ldcs_ros.scene import load_scene

    shipped, law = WITH_LAW.get(name, (name, None))
    content = load_scene(shipped).content
    if law is not None:
        next(effect for effect in content["effects"] if effect["type"] == "springs")["law"] = law
    if nodes is not None and content["lattice"]["nodes"] != [nodes, nodes]:
        content["lattice"]["nodes"] = [nodes, nodes]
        content["points"] = {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]}
        content.pop("sensors", None)
    return content


def scene_of(name: str, nodes: int | None = None, **solver: Any) -> Scene:
    """Return a problem's scene with a solver block, for example `integrator="rkc2", accuracy=1e-5`."""
    from ldcs_ros.scene import load_scene

    content = content_of(name, nodes)
    if solver:
        content["solver"] = solver
    return load_scene(content)


def positions(simulation: Simulation, times: tuple[float, ...]) -> np.ndarray:
    """Advance a simulation through times [s]; return all node positions there [m], shape (n_times, n_nodes,
    3)."""
    course = []
    for time in times:
        simulation.advance_to(time)
        course.append(simulation.state.position)
    return np.array(course)

"""Problems of the studies: shipped scenes with another lattice, law or solver, and the times of their errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.scene import load_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation

ERROR_TIMES = (0.5, 1.0, 2.0, 3.0)
WITH_LAW = {"arc_axiswise": ("arc", "axiswise")}


def content_of(name: str, nodes: int | None = None) -> dict[str, Any]:
    """Return the content of a problem's scene, with nodes x nodes nodes if a number is given."""
    shipped, law = WITH_LAW.get(name, (name, None))
    content = load_scene(shipped).content
    if law is not None:
        next(effect for effect in content["effects"] if effect["type"] == "springs")["law"] = law
    if nodes is not None and content["lattice"]["nodes"] != [nodes, nodes]:
        content["lattice"]["nodes"] = [nodes, nodes]
        content["points"] = {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]}
        content.pop("sensors", None)
    return content


def scene_of(name: str, nodes: int | None = None, **solver: str | float) -> Scene:
    """Return a problem's scene with a solver block, for example `integrator="rkc2", accuracy=1e-5`."""
    content = content_of(name, nodes)
    if solver:
        content["solver"] = solver
    return load_scene(content)


def positions(
    simulation: Simulation,
    times: tuple[float, ...],
    advance: Callable[[Simulation, float], None] | None = None,
) -> np.ndarray:
    """Advance through times [s] and return all node positions there [m], shape (n_times, n_nodes, 3).

    Args:
        simulation: The simulation.
        times: Increasing times [s].
        advance: Function that advances the simulation to a time; `advance_to` if none is given.
    """
    found = []
    for time in times:
        if advance is None:
            simulation.advance_to(time)
        else:
            advance(simulation, time)
        found.append(simulation.state.position)
    return np.array(found)


def spectral_radius(name: str, nodes: int) -> float:
    """Return the spectral radius of a problem's linearised system at its start [1/s]."""
    simulation = scene_of(name, nodes).build()
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    return mode.spectral_radius

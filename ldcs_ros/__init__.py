"""ldcs_ros: a digital twin of a soft robotic surface that two pneumatic continuum arms lift and curve.

The data flow:

    scene file -> Scene -> Model (only the effects the scene names) -> Simulation (model + integrator) -> State
                                                                          |            |
    commands (pressure, torque, wrench) -> Inputs ------------------------+            +-> sensors -> messages, bag

    from ldcs_ros import load_scene
    simulation = load_scene("paper").build()
    simulation.advance_to(2.0)
    print(simulation.pose("P1"))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ldcs_ros.scene import Scene, load_scene, shipped_scenes
    from ldcs_ros.simulation.simulation import Simulation

__version__ = "0.1.0"

__all__ = ["Scene", "Simulation", "__version__", "load_scene", "shipped_scenes"]

_HOMES = {
    "Scene": "ldcs_ros.scene",
    "load_scene": "ldcs_ros.scene",
    "shipped_scenes": "ldcs_ros.scene",
    "Simulation": "ldcs_ros.simulation.simulation",
}


def __getattr__(name: str) -> Any:
    # Loaded at first use, so that `ldcs --help` does not wait for numpy.
    if name not in _HOMES:
        raise AttributeError(f"module 'ldcs_ros' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)

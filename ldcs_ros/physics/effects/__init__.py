"""One physical effect a file; a new one takes four steps.

1. Write `effects/<name>.py`: a frozen dataclass `<Name>(Effect)` with `name = '<name>'` and SI fields, and
   its term.
2. Add its line to `EFFECTS` below; the scene keys, `ldcs effects` and the bounds follow from its fields.
3. Run `pytest test/physics`: every effect of the table is checked, force against energy, Jacobian against
   force.
4. Ship or extend a scene that shows it, with a test that asserts one number.

The table holds names, not classes, so that a scene imports only the effects that it names.
"""

from __future__ import annotations

import importlib

EFFECTS: dict[str, str] = {
    "springs": "ldcs_ros.physics.effects.springs:Springs",
    "gravity": "ldcs_ros.physics.effects.gravity:Gravity",
    "clamp": "ldcs_ros.physics.effects.clamp:Clamp",
    "force": "ldcs_ros.physics.effects.force:Force",
    "payload": "ldcs_ros.physics.effects.payload:Payload",
    "wrench": "ldcs_ros.physics.effects.wrench:WrenchInput",
    "driven_edges": "ldcs_ros.physics.effects.driven_edges:DrivenEdges",
    "arms": "ldcs_ros.physics.effects.arms:Arms",
    "support": "ldcs_ros.physics.effects.support:Support",
    "floor": "ldcs_ros.physics.effects.floor:Floor",
    "drag": "ldcs_ros.physics.effects.drag:Drag",
}


def effect_class(name: str) -> type:
    """Import and return the class of an effect by its name in `EFFECTS`."""
    module, _, attribute = EFFECTS[name].partition(":")
    loaded: type = getattr(importlib.import_module(module), attribute)
    return loaded

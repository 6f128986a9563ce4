"""A scene's text with every default written out, so that a bag means the same when a default has changed."""

from __future__ import annotations

import dataclasses

from ldcs_ros.errors import SceneError
from ldcs_ros.scene.scene import Scene, parse_scene
from ldcs_ros.schema.reader import plain_values, write_yaml


def complete_text(scene: Scene) -> str:
    """Return the scene as YAML text that names every parameter of its effects, sensors and solver.

    It means the very same scene; where that cannot be written down, the scene's own text is returned.
    """
    content = scene.content
    for block, effect in zip(content.get("effects", []), scene.effects, strict=True):
        for field in dataclasses.fields(effect):  # type: ignore[arg-type]
            value = getattr(effect, field.name)
            # None and an empty list have no spelling of their own: the key is absent.
            if field.name not in block and value not in (None, ()) and value == field.default:
                block[field.name] = value
    if scene.sensors:
        content["sensors"] = scene.sensors
    solver = dataclasses.asdict(scene.solver)
    content["solver"] = {key: value for key, value in solver.items() if value not in (None, False)}
    text = write_yaml(plain_values(content, origin=scene.name, error=SceneError))
    try:
        again = parse_scene(text, name=scene.name, origin=scene.name)
    except SceneError:
        return scene.text
    same = (again.effects, again.sensors, again.solver, again.inputs) == (
        scene.effects,
        scene.sensors,
        scene.solver,
        scene.inputs,
    )
    return text if same else scene.text

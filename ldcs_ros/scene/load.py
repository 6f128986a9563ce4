"""From a shipped name, a path, a dict or a text to a `Scene`, and back to a text with every default written out."""

from __future__ import annotations

import dataclasses
import importlib.resources
import os
from pathlib import Path
from typing import Any

from ldcs_ros.errors import SceneError, user_path
from ldcs_ros.scene.scene import Scene, parse_scene, scene_of_content
from ldcs_ros.schema.fields import did_you_mean, shown
from ldcs_ros.schema.reader import plain_values, read_text, write_yaml

__all__ = ["complete_text", "load_scene", "parse_scene", "scene_of", "shipped_scenes"]

MAX_SHOWN = 200


def shipped_scenes() -> dict[str, Path]:
    """Return the shipped scenes by name."""
    folder = Path(str(importlib.resources.files("ldcs_ros"))) / "scenes"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_scene(source: str | os.PathLike[str] | dict[str, Any]) -> Scene:
    """Return the scene of a shipped name, a YAML file or a dict with the same keys; NumPy numbers are numbers.

    Raises:
        SceneError: It cannot be found or read, or is not a valid scene; nothing was built.
    """
    if isinstance(source, dict):
        content = plain_values(source, origin="the scene", error=SceneError)
        return scene_of_content(content, None, name="scene")
    shipped = shipped_scenes()
    path = user_path(source)
    if str(source) in shipped:
        path = shipped[str(source)]
    elif not os.path.isfile(path):  # Path.is_file fails at names that no file can have
        hint = did_you_mean(str(source), shipped)
        raise SceneError(
            f"no scene {shown(str(source), most=MAX_SHOWN)}: "
            f"neither a file nor a shipped scene out of {list(shipped)}.{hint}"
        )
    return parse_scene(read_text(path, "scene", SceneError), name=path.stem, origin=path.name)


def scene_of(source: str) -> Scene:
    """Return the scene that a text names or is; YAML has more than one line, or begins with a brace.

    Raises:
        SceneError: It cannot be found or is not a valid scene.
    """
    if "\n" not in source.strip() and not source.lstrip().startswith("{"):
        return load_scene(source.strip())
    return parse_scene(source, name="scene", origin="the text")


def complete_text(scene: Scene) -> str:
    """Return the scene as YAML text that names every parameter of its effects, sensors and solver.

    A bag with this text means the same when a default has changed. Where the very same scene cannot be written down,
    the scene's own text is returned.
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

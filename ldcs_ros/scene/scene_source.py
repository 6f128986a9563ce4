"""A scene by one text: the name of a shipped one, a path, or the YAML itself."""

from __future__ import annotations

from ldcs_ros.errors import SceneError
from ldcs_ros.scene.load import MOST_BYTES, load_scene, parse_scene
from ldcs_ros.scene.scene import Scene


def scene_of(source: str) -> Scene:
    """Return the scene that a text names or is; YAML has more than one line, or begins with a brace.

    Raises:
        SceneError: It cannot be found or is not sound.
    """
    if "\n" not in source.strip() and not source.lstrip().startswith("{"):
        return load_scene(source.strip())
    if len(source) > MOST_BYTES:
        raise SceneError(f"the text has {len(source)} characters, expected a scene of at most {MOST_BYTES}")
    return parse_scene(source, name="scene", origin="the text")

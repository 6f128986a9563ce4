"""The argument SCENE with its `--set` changes: a shipped name or a file, to a checked Scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ldcs_ros.cli.overrides import apply_overrides


def scene_with(source: str, overrides: Sequence[str]) -> Any:
    """Return the scene of a shipped name or path with `path=value` changes, checked as a whole.

    Raises:
        SceneError: There is no such scene, or it is not valid, before or after the changes.
    """
    from ldcs_ros.scene.load import load_scene

    return changed_scene(load_scene(source), overrides)


def changed_scene(scene: Any, overrides: Sequence[str]) -> Any:
    """Return a scene with `path=value` changes, checked as a whole.

    Raises:
        SceneError: It is not valid after the changes.
    """
    import yaml

    from ldcs_ros.scene.load import parse_scene

    if not overrides:
        return scene
    content = apply_overrides(yaml.safe_load(scene.text), overrides)
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    return parse_scene(text, name=scene.name, origin=f"{scene.name} with --set")

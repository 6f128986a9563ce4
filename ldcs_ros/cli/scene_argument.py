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
    from ldcs_ros import load_scene

    scene = load_scene(source)
    if not overrides:
        return scene
    return load_scene(apply_overrides(scene.content, overrides))

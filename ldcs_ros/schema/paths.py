"""Paths into a scene's content, such as `effects.springs.stiffness` or `inputs[0].torque`: read and put values."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from typing import Any

from ldcs_ros.errors import SceneError
from ldcs_ros.schema.fields import finite_number

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


def get_value(content: dict[str, Any], path: str) -> object:
    """Return the value at a path of a scene's content; None where the last key is not given.

    Raises:
        SceneError: The path leads nowhere.
    """
    holder, last, walked = _holder(content, path, path, make=False)
    if isinstance(holder, dict) and isinstance(last, str):
        return holder.get(last)
    entries, index = _entry(holder, last, walked, path)
    return entries[index]


def get_number(content: dict[str, Any], path: str) -> float:
    """Return the finite number at a path of a scene's content.

    Raises:
        SceneError: The path leads nowhere, or to something else.
    """
    try:
        return finite_number(get_value(content, path))
    except ValueError as error:
        raise SceneError(f"{error} @ {path}") from error


def put_value(content: dict[str, Any], path: str, value: object, *, said: str = "") -> None:
    """Put a value at a path of a scene's content, in place.

    A path names keys joined by dots; a list takes an index, `effects[0].stiffness`, or an entry's type or name,
    `effects.springs.stiffness`, `effects.arms.arms.left.links`. The scene's own check judges unknown keys.

    Args:
        content: The scene as plain values.
        path: Path of the value.
        value: The value.
        said: Text that an error quotes; the path if not given.

    Raises:
        SceneError: The path leads nowhere.
    """
    holder, last, walked = _holder(content, path, said or path, make=True)
    if isinstance(holder, dict) and isinstance(last, str):
        holder[last] = value
    else:
        entries, index = _entry(holder, last, walked, said or path)
        entries[index] = value


def remove_value(content: dict[str, Any], path: str) -> None:
    """Remove a key or a list's entry at a path of a scene's content, in place; a key that is absent is no error.

    Raises:
        SceneError: The path leads nowhere.
    """
    holder, last, walked = _holder(content, path, path, make=False)
    if isinstance(holder, dict) and isinstance(last, str):
        holder.pop(last, None)
    else:
        entries, index = _entry(holder, last, walked, path)
        del entries[index]


def with_values(content: dict[str, Any], values: Mapping[str, object]) -> dict[str, Any]:
    """Return a copy of a scene's content with values at some paths.

    Raises:
        SceneError: A path leads nowhere.
    """
    changed = copy.deepcopy(content)
    for path, value in values.items():
        put_value(changed, path, value)
    return changed


def _holder(content: dict[str, Any], path: str, said: str, *, make: bool) -> tuple[object, str | int, str]:
    steps = _split(path, said)
    holder: object = content
    walked = "scene"
    for step in steps[:-1]:
        if isinstance(holder, dict) and isinstance(step, str):
            holder = holder.setdefault(step, {}) if make else holder.get(step, {})
        else:
            entries, index = _entry(holder, step, walked, said)
            holder = entries[index]
        walked = f"{walked}.{step}"
    return holder, steps[-1], walked


def _split(path: str, said: str) -> list[str | int]:
    steps: list[str | int] = []
    end = 0
    for match in _STEP.finditer(path):
        if path[end : match.start()] not in ("", "."):
            break
        steps.append(match.group(1) if match.group(1) is not None else int(match.group(2)))
        end = match.end()
    if end != len(path) or not steps:
        raise SceneError(f"'{said}': cannot read the path '{path}'; write it as effects[0].stiffness")
    return steps


def _entry(holder: object, step: str | int, walked: str, said: str) -> tuple[list[object], int]:
    # The list that holds a step's entry, and the index of the entry.
    if not isinstance(holder, list):
        kind = "a table" if isinstance(holder, dict) else f"the value {holder!r}"
        raise SceneError(f"'{said}': {walked} is {kind}, which has no place '{step}'")
    if isinstance(step, int):
        if step >= len(holder):
            raise SceneError(f"'{said}': {walked} has {len(holder)} entries, got index {step}")
        return holder, step
    names = [entry.get("type", entry.get("name")) if isinstance(entry, dict) else None for entry in holder]
    if names.count(step) != 1:
        known = [name for name in names if name is not None]
        found = "no entry" if step not in names else "more than one entry"
        raise SceneError(
            f"'{said}': {walked} has {found} of the type or name '{step}', only {known}; or give an index, [0]"
        )
    return holder, names.index(step)

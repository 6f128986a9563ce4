"""`--set path=value`: change single keys of a scene before it is checked and built."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from typing import Any

from ldcs_ros.errors import SceneError

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


def apply_overrides(content: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Return a copy of a scene's content with each `path=value` put in.

    A path names keys joined by dots; a list takes an index, `effects[0].stiffness`, or an entry's type,
    `effects.springs.stiffness`.
    Unknown keys are left to the scene's own check, which knows what is allowed.

    Raises:
        SceneError: The text is not `path=value`, or the path leads nowhere.
    """
    changed = copy.deepcopy(content)
    for override in overrides:
        path, equals, text = override.partition("=")
        if not equals or not path.strip():
            raise SceneError(
                f"--set '{override}' is not path=value; write for example --set lattice.nodes=[17,17]"
            )
        _put(changed, _split(path.strip(), override), parse_value(text.strip()), override)
    return changed


def parse_value(text: str) -> Any:
    """The value that a text means in a scene file: number, list, word, true / false, null."""
    import yaml

    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)  # YAML 1.1 takes 1e-6 for a word
    except ValueError:
        pass
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SceneError(
            f"--set value '{text}' is not YAML: {error}; quote lists as in --set 'lattice.nodes=[17,17]'"
        ) from error


def _split(path: str, override: str) -> list[str | int]:
    steps: list[str | int] = []
    end = 0
    for match in _STEP.finditer(path):
        if path[end : match.start()] not in ("", "."):
            break
        steps.append(match.group(1) if match.group(1) is not None else int(match.group(2)))
        end = match.end()
    if end != len(path):
        raise SceneError(
            f"--set '{override}': cannot read the path '{path}'; write it as effects[0].stiffness"
        )
    return steps


def _put(content: dict[str, Any], steps: list[str | int], value: Any, override: str) -> None:
    holder: Any = content
    walked = "scene"
    for step in steps[:-1]:
        if isinstance(holder, dict) and isinstance(step, str):
            holder = holder.setdefault(step, {})
        else:
            holder = holder[_index(holder, step, walked, override)]
        walked = f"{walked}.{step}"
    last = steps[-1]
    if isinstance(holder, dict) and isinstance(last, str):
        holder[last] = value
    else:
        holder[_index(holder, last, walked, override)] = value


def _index(holder: Any, step: str | int, walked: str, override: str) -> int:
    if not isinstance(holder, list):
        kind = "a table" if isinstance(holder, dict) else f"the value {holder!r}"
        raise SceneError(f"--set '{override}': {walked} is {kind}, which has no place '{step}'")
    if isinstance(step, int):
        if step >= len(holder):
            raise SceneError(f"--set '{override}': {walked} has {len(holder)} entries, got index {step}")
        return step
    types = [entry.get("type") if isinstance(entry, dict) else None for entry in holder]
    if types.count(step) != 1:
        known = [name for name in types if name is not None]
        found = "no entry" if step not in types else "more than one entry"
        raise SceneError(
            f"--set '{override}': {walked} has {found} of type '{step}', only {known}; or give an index, [0]"
        )
    return types.index(step)

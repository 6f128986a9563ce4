"""`--set path=value`: change single keys of a scene before it is checked and built."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

from ldcs_ros.errors import SceneError


def apply_overrides(content: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Return a copy of a scene's content with each `path=value` put in.

    A path names keys joined by dots; a list takes an index, `effects[0].stiffness`, or an entry's type,
    `effects.springs.stiffness`.
    Unknown keys are left to the scene's own check, which knows what is allowed.

    Raises:
        SceneError: The text is not `path=value`, or the path leads nowhere.
    """
    from ldcs_ros.schema.paths import put_value

    changed = copy.deepcopy(content)
    for override in overrides:
        path, equals, text = override.partition("=")
        if not equals or not path.strip():
            raise SceneError(
                f"--set '{override}' is not path=value; write for example --set lattice.nodes=[17,17]"
            )
        try:
            put_value(changed, path.strip(), parse_value(text.strip()), said=override)
        except SceneError as error:
            raise SceneError(f"--set {error}") from error
    return changed


def parse_value(text: str) -> object:
    """Return the value of a text in a scene file: number, list, word, true / false, null."""
    from ldcs_ros.schema.reader import read_yaml

    try:
        return read_yaml(text, origin="--set", error=SceneError)
    except SceneError as error:
        raise SceneError(f"{error}; quote lists as in --set 'lattice.nodes=[17,17]'") from error

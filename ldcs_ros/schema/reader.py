"""Checks of what a person wrote into a YAML file, value by value; each complaint says what, got, expected and where."""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path
from typing import Any, NoReturn

import yaml

from ldcs_ros.errors import LdcsError

MOST_BYTES = 1_000_000


class Checks:
    """Checks that raise one kind of error; a `path` names the place in the file, such as 'links[0].rate'.

    Args:
        error: What is raised.
    """

    def __init__(self, error: type[LdcsError]) -> None:
        self._error = error

    def read(self, path: Path, what: str) -> str:
        """Return the text of a file; `what` names its kind."""
        try:
            if path.stat().st_size > MOST_BYTES:
                raise self._error(f"{path} is no {what}: it has more than {MOST_BYTES} bytes")
            return path.read_text(encoding="utf-8")
        except OSError as error:
            raise self._error(f"cannot read the {what} {path}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise self._error(f"the {what} {path} is not UTF-8 text") from error

    def content(self, text: str, name: str) -> Any:
        """Return the content of YAML text; `name` names the file."""
        try:
            return yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise self._error(f"{name} is no YAML: {' '.join(str(error).split())}") from error

    def keys(
        self, value: Any, known: Collection[str], path: str, *, required: Collection[str] = ()
    ) -> dict[str, Any]:
        """Return a mapping whose keys are all known and that has those that are required."""
        if not isinstance(value, dict):
            self.refuse(value, f"a mapping with keys out of {list(known)}", path)
        for key in value:
            if key not in known:
                raise self._error(f"unknown key {key!r}; expected one of {list(known)} @ {path}")
        for key in required:
            if key not in value:
                raise self._error(f"missing key {key!r} @ {path}")
        return value

    def items(self, value: Any, path: str) -> list[Any]:
        """Return a list."""
        if not isinstance(value, list):
            self.refuse(value, "a list", path)
        return value

    def choice(self, value: Any, known: Collection[str], path: str) -> str:
        """Return one of a few words."""
        if not isinstance(value, str) or value not in known:
            self.refuse(value, f"one of {list(known)}", path)
        return value

    def text(self, value: Any, path: str) -> str:
        """Return a text."""
        if not isinstance(value, str):
            self.refuse(value, "text", path)
        return value

    def number(self, value: Any, path: str, *, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number within its bounds."""
        sound = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        if not sound or not low <= value <= high:
            bounds = "" if math.isinf(low) else f" of at least {low:g}"
            if math.isfinite(high):
                bounds = f" {low:g} ... {high:g}"
            # YAML 1.1 reads 1e-5 as text: say how to write it.
            hint = (
                " (write 1.0e-5, YAML reads 1e-5 as text)"
                if isinstance(value, str) and "e" in value.lower()
                else ""
            )
            self.refuse(value, f"a finite number{bounds}{hint}", path)
        return float(value)

    def numbers(
        self, value: Any, length: int, path: str, *, low: float = -math.inf, high: float = math.inf
    ) -> tuple[float, ...]:
        """Return a list of so many numbers."""
        if not isinstance(value, list) or len(value) != length:
            self.refuse(value, f"{length} numbers", path)
        return tuple(self.number(item, path, low=low, high=high) for item in value)

    def refuse(self, value: Any, expected: str, path: str) -> NoReturn:
        """Raise the error for a value that is not what was expected."""
        shown = repr(value)
        shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
        raise self._error(f"got {shown}, expected {expected} @ {path}")

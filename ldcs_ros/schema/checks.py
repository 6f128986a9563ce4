"""Checks of a file's content, value by value; each error says got, expected and the path of the key."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from ldcs_ros.errors import LdcsError
from ldcs_ros.schema.fields import check_field, did_you_mean, finite_number, shown, whole_number


class Checks:
    """Checks that raise one kind of error; a `path` names the place in the file, such as 'links[0].rate'.

    Args:
        error: Class of the errors.
    """

    def __init__(self, error: type[LdcsError]) -> None:
        self._error = error

    def keys(
        self, value: object, known: Collection[str], path: str, *, required: Collection[str] = ()
    ) -> dict[str, Any]:
        """Return a mapping whose keys are all known and that has those that are required; '' is the whole file."""
        place = path or "the file"
        if not isinstance(value, dict):
            self.refuse(value, f"a mapping with keys out of {list(known)}", place)
        for key in value:
            if key not in known:
                hint = did_you_mean(key, known)
                raise self._error(f"unknown key {shown(key)}; expected one of {list(known)}.{hint} @ {place}")
        for key in required:
            if key not in value:
                raise self._error(f"missing key {key!r} @ {place}")
        return value

    def items(self, value: object, path: str) -> list[object]:
        """Return a list."""
        if not isinstance(value, list):
            self.refuse(value, "a list", path)
        return value

    def choice(self, value: object, known: Collection[str], path: str) -> str:
        """Return one of a few words."""
        if not isinstance(value, str) or value not in known:
            self.refuse(value, f"one of {list(known)}.{did_you_mean(value, known)}".removesuffix("."), path)
        return value

    def text(self, value: object, path: str) -> str:
        """Return a text."""
        if not isinstance(value, str):
            self.refuse(value, "text", path)
        return value

    def truth(self, value: object, path: str) -> bool:
        """Return true or false."""
        if not isinstance(value, bool):
            self.refuse(value, "true or false", path)
        return value

    def number(
        self, value: object, path: str, *, low: float = -math.inf, high: float = math.inf, unit: str = ""
    ) -> float:
        """Return a finite number within its bounds."""
        with self.at(path):
            return finite_number(value, low=low, high=high, unit=unit)

    def whole(self, value: object, path: str, *, low: float = -math.inf, high: float = math.inf) -> int:
        """Return a whole number within its bounds."""
        with self.at(path):
            return whole_number(value, low=low, high=high)

    def numbers(
        self,
        value: object,
        length: int,
        path: str,
        *,
        low: float = -math.inf,
        high: float = math.inf,
        unit: str = "",
    ) -> tuple[float, ...]:
        """Return a list of `length` finite numbers as a tuple."""
        if not isinstance(value, (list, tuple)) or len(value) != length:
            self.refuse(value, f"a list of {length} numbers{f' [{unit}]' if unit else ''}", path)
        return tuple(
            self.number(item, f"{path}[{k}]", low=low, high=high, unit=unit) for k, item in enumerate(value)
        )

    def declared(self, cls: type, block: object, path: str, *, extra: tuple[str, ...] = ()) -> dict[str, Any]:
        """Return the values of a block whose keys are the declared fields of a dataclass.

        Args:
            cls: A dataclass whose fields are made by `quantity`, `choice`, `choices` and `location`.
            block: The block of the file.
            path: Its place.
            extra: Keys that are known but belong to no field; they are left out.
        """
        fields = {field.name: field for field in dataclasses.fields(cls) if "unit" in field.metadata}
        required = [name for name, field in fields.items() if field.default is dataclasses.MISSING]
        given = self.keys(block, (*extra, *fields), path, required=required)
        values = {}
        for key, value in given.items():
            if key in fields:
                with self.at(f"{path}.{key}"):
                    values[key] = check_field(value, fields[key])
        return values

    @contextmanager
    def at(self, path: str) -> Iterator[None]:
        """Turn each ValueError of the block into this kind of error, with its place."""
        try:
            yield
        except ValueError as error:
            raise self._error(f"{error} @ {path}") from error

    def refuse(self, value: object, expected: str, path: str) -> NoReturn:
        """Raise the error for a value that is not the expected one."""
        raise self._error(f"got {shown(value)}, expected {expected} @ {path}")

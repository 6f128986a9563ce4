"""How an effect declares a parameter: default, unit, bounds, origin and meaning in one place."""

from __future__ import annotations

import dataclasses
import difflib
import math
from typing import Any

REQUIRED = dataclasses.MISSING


def did_you_mean(word: str, options: Any) -> str:
    """Return ` Did you mean 'x'?` for the nearest option, or nothing."""
    near = difflib.get_close_matches(str(word), [str(option) for option in options], n=1)
    return f" Did you mean {near[0]!r}?" if near else ""


def quantity(
    default: Any,
    unit: str,
    help: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    origin: str = "choice of this project",
    length: int | None = None,
) -> Any:
    """Declare a numeric field of a frozen dataclass.

    Args:
        default: Value used when the scene does not name it; `REQUIRED` when it must.
        unit: SI unit, '' for pure numbers.
        help: What it means, one clause.
        low: Smallest accepted value.
        high: Largest accepted value.
        origin: Where the default comes from.
        length: Number of components of a vector, None for one number.
    """
    metadata = {"unit": unit, "help": help, "low": low, "high": high, "origin": origin, "length": length}
    return dataclasses.field(default=default, metadata=metadata)


def choice(
    default: Any, options: tuple[str, ...], help: str, *, origin: str = "choice of this project"
) -> Any:
    """Declare a field that holds one of a few words."""
    return dataclasses.field(
        default=default, metadata={"options": options, "help": help, "origin": origin, "unit": ""}
    )


def place(default: Any, help: str) -> Any:
    """Declare a field that names a point: a point of the scene, or [layer, i, j]."""
    return dataclasses.field(
        default=default, metadata={"place": True, "help": help, "unit": "", "origin": "scene"}
    )


def words(default: Any, options: tuple[str, ...], help: str) -> Any:
    """Declare a field that holds a list of different words out of a few."""
    metadata = {
        "options": options,
        "several": True,
        "help": help,
        "unit": "",
        "origin": "choice of this project",
    }
    return dataclasses.field(default=default, metadata=metadata)


def check_number(value: Any, field: dataclasses.Field[Any]) -> Any:
    """Return the value of a `quantity` field as float, int or tuple; raise ValueError with got and expected."""
    meta = field.metadata
    if meta["length"] is not None:
        if not isinstance(value, (list, tuple)) or len(value) != meta["length"]:
            raise ValueError(f"got {value!r}, expected a list of {meta['length']} numbers [{meta['unit']}]")
        return tuple(_scalar(item, meta) for item in value)
    whole = field.type in ("int", int)
    if whole and (isinstance(value, bool) or not isinstance(value, int)):
        raise ValueError(f"got {value!r}, expected a whole number")
    number = _scalar(value, meta)
    return int(number) if whole else number


def check_choice(value: Any, field: dataclasses.Field[Any]) -> Any:
    """Return the value of a `choice` or `words` field; raise ValueError with got and expected."""
    options = field.metadata["options"]
    items = value if field.metadata.get("several") else [value]
    if not isinstance(items, (list, tuple)) or not items or len(set(map(str, items))) != len(items):
        raise ValueError(f"got {value!r}, expected a list of different words out of {list(options)}")
    for item in items:
        if item not in options:
            raise ValueError(f"got {item!r}, expected one of {list(options)}.{did_you_mean(item, options)}")
    return tuple(items) if field.metadata.get("several") else value


def _scalar(value: Any, meta: Any) -> float:
    unit = f" [{meta['unit']}]" if meta["unit"] else ""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        # YAML 1.1 reads 1e-5 as text: say how to write it.
        hint = (
            " (write 1.0e-5, YAML reads 1e-5 as text)"
            if isinstance(value, str) and "e" in value.lower()
            else ""
        )
        raise ValueError(f"got {value!r}, expected a finite number{unit}{hint}")
    if not meta["low"] <= value <= meta["high"]:
        raise ValueError(f"got {value:g}, expected {meta['low']:g} ... {meta['high']:g}{unit}")
    return float(value)

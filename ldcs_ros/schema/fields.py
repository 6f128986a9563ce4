"""Declarations of a parameter (default, unit, bounds, source and meaning in one place) and the check of its value."""

from __future__ import annotations

import dataclasses
import difflib
import math
import numbers
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeVar

from ldcs_ros.errors import LdcsError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class SheetPlace:
    """A place on the flat sheet in metres.

    Attributes:
        x: Coordinate along the sheet in ldcs_base [m].
        y: Coordinate across it [m].
        layer: bottom, top, or mid: the mean of both.
    """

    x: float
    y: float
    layer: str = "mid"


Location = str | tuple[str | int, ...] | SheetPlace
"""The name of a point, (layer, i, j), or a place in metres."""

# Any: the default of a field that has none is of every type.
REQUIRED: Any = dataclasses.MISSING
PROJECT = "choice of this project"
MAX_SHOWN = 60


def shown(value: object, *, most: int = MAX_SHOWN) -> str:
    """Return a value for an error: one line of at most `most` characters."""
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a whole number of {value.bit_length()} bits"
    try:
        text = repr(value)
    except (
        ValueError,
        RecursionError,
    ):  # an integer of thousands of digits inside, or a list that holds itself
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 3]}..."


def did_you_mean(word: object, options: Iterable[object]) -> str:
    """Return ` Did you mean 'x'?` for the nearest option, or nothing.

    >>> did_you_mean("stifness", ["stiffness", "damping"])
    " Did you mean 'stiffness'?"
    """
    near = difflib.get_close_matches(str(word)[:MAX_SHOWN], [str(option) for option in options], n=1)
    return f" Did you mean {near[0]!r}?" if near else ""


def quantity(
    default: T,
    unit: str,
    help: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    source: str = PROJECT,
    length: int | None = None,
) -> T:
    """Declare a numeric field of a frozen dataclass.

    Args:
        default: Value of a file that does not name the field; `REQUIRED` if each file must.
        unit: SI unit, '' for pure numbers.
        help: Meaning, one clause.
        low: Smallest accepted value.
        high: Largest accepted value.
        source: Source of the default.
        length: Number of components of a vector, None for one number.
    """
    return _declared(default, unit=unit, help=help, low=low, high=high, source=source, length=length)


def choice(default: T, options: tuple[str, ...], help: str, *, source: str = PROJECT) -> T:
    """Declare a field that holds one of a few words."""
    return _declared(default, options=options, help=help, source=source, unit="")


def choices(default: T, options: tuple[str, ...], help: str) -> T:
    """Declare a field that holds a list of different words out of a few."""
    return _declared(default, options=options, several=True, help=help, source=PROJECT, unit="")


def location(default: T, help: str) -> T:
    """Declare a field that names a point: a point of the scene, or [layer, i, j]."""
    return _declared(default, location=True, help=help, source="scene", unit="")


def _declared(default: T, **metadata: object) -> T:
    return dataclasses.field(default=default, metadata=metadata)


def finite_number(value: object, *, low: float = -math.inf, high: float = math.inf, unit: str = "") -> float:
    """Return a finite number within its bounds as float; NumPy numbers are numbers.

    >>> finite_number(3, low=0.0, unit="m")
    3.0

    Raises:
        ValueError: It is something else; the message says got and expected.
    """
    suffix = f" [{unit}]" if unit else ""
    number = math.nan
    if not isinstance(value, bool) and isinstance(value, numbers.Real):
        try:
            number = float(value)
        except OverflowError:  # an integer above every float
            number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"got {shown(value)}, expected a finite number{suffix}{_quotes(value)}")
    if not low <= number <= high:
        raise ValueError(f"got {number:g}, expected {_range(low, high)}{suffix}")
    return number


def whole_number(value: object, *, low: float = -math.inf, high: float = math.inf) -> int:
    """Return a whole number within its bounds.

    Raises:
        ValueError: It is something else; the message says got and expected.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise ValueError(f"got {shown(value)}, expected a whole number{_quotes(value)}")
    number = int(value)
    if not low <= number <= high:
        raise ValueError(f"got {shown(number)}, expected {_range(low, high)}")
    return number


def check_field(value: object, field: dataclasses.Field[Any]) -> object:
    """Return the value of a declared field as float, int, tuple or word.

    Raises:
        ValueError: It breaks the field's declaration; the message says got and expected.
    """
    meta = field.metadata
    if "options" in meta:
        return _chosen(value, meta["options"], several="several" in meta)
    if "location" in meta:
        return as_location(value)
    bounds = {"low": meta["low"], "high": meta["high"]}
    if meta["length"] is not None:
        if not isinstance(value, (list, tuple)) or len(value) != meta["length"]:
            raise ValueError(
                f"got {shown(value)}, expected a list of {meta['length']} numbers [{meta['unit']}]"
            )
        return tuple(finite_number(item, unit=meta["unit"], **bounds) for item in value)
    if field.type in ("int", int):
        return whole_number(value, **bounds)
    return finite_number(value, unit=meta["unit"], **bounds)


def as_location(value: object) -> object:
    """Return the place of `{x, y, layer}`, a tuple of a list, and other values as they are.

    Raises:
        ValueError: A mapping with other keys, or a value that is no coordinate or layer.
    """
    if isinstance(value, dict):
        unknown = [key for key in value if key not in ("x", "y", "layer")]
        if unknown or "x" not in value or "y" not in value:
            raise ValueError(f"got {shown(value)}, expected {{x: m, y: m, layer: bottom, top or mid}}")
        layer = _chosen(value.get("layer", "mid"), ("bottom", "top", "mid"), several=False)
        return SheetPlace(
            finite_number(value["x"], unit="m"), finite_number(value["y"], unit="m"), str(layer)
        )
    return tuple(value) if isinstance(value, list) else value


def check_fields(instance: DataclassInstance, path: str, error: type[LdcsError]) -> None:
    """Check every declared field of a dataclass instance; for `__post_init__` of one that programs make, too.

    Raises:
        LdcsError: A value breaks its field's declaration; the class is `error`.
    """
    for field in dataclasses.fields(instance):
        if "unit" in field.metadata:
            try:
                check_field(getattr(instance, field.name), field)
            except ValueError as reason:
                raise error(f"{reason} @ {path}.{field.name}") from reason


def _chosen(value: object, options: tuple[str, ...], *, several: bool) -> object:
    items = value if several else [value]
    if not isinstance(items, (list, tuple)) or not items or len(set(map(str, items))) != len(items):
        raise ValueError(f"got {shown(value)}, expected a list of different words out of {list(options)}")
    for item in items:
        if item not in options:
            raise ValueError(
                f"got {shown(item)}, expected one of {list(options)}.{did_you_mean(item, options)}"
            )
    return tuple(items) if several else value


def _range(low: float, high: float) -> str:
    if math.isinf(high):
        return f"at least {low:g}"
    return f"at most {high:g}" if math.isinf(low) else f"{low:g} ... {high:g}"


def _quotes(value: object) -> str:
    try:
        return " without quotes" if isinstance(value, str) and math.isfinite(float(value)) else ""
    except ValueError:
        return ""

"""`ldcs effects`: every physical effect, what it does, and its parameters with unit, bounds and origin."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import inspect
import math
import textwrap
from typing import Any

from ldcs_ros.cli.output import print_json
from ldcs_ros.errors import SceneError

DESCRIPTION = """\
List the physical effects that a scene can name: the physics of each, and its parameters with default, unit, bounds
and origin. A scene pays only for the effects that it names."""
EXAMPLE = """\
ldcs effects
  ldcs effects springs arms"""

_WIDTH = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "names",
        metavar="EFFECT",
        nargs="*",
        help="effects to explain in full; all, in short, if none is named",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the effects; exit status 0."""
    from ldcs_ros.physics.effects import EFFECTS

    for name in arguments.names:
        if name not in EFFECTS:
            near = difflib.get_close_matches(name, EFFECTS, n=1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            raise SceneError(f"unknown effect '{name}', expected one of {list(EFFECTS)}{hint}")
    described = [describe(name) for name in arguments.names or EFFECTS]
    if arguments.json:
        print_json({"effects": described})
        return 0
    print("\n\n".join(_text(effect, whole=bool(arguments.names)) for effect in described))
    return 0


def describe(name: str) -> dict[str, Any]:
    """Return an effect's name, description and parameters, as plain values, from its dataclass."""
    from ldcs_ros.physics.effects import effect_class

    return {"name": name, **describe_class(effect_class(name))}


def describe_class(cls: type) -> dict[str, Any]:
    """Return the description and the parameters of a dataclass of quantities, as plain values."""
    description = inspect.cleandoc(cls.__doc__ or "").split("\nAttributes:")[0].strip()
    fields = [field for field in dataclasses.fields(cls) if field.init]
    return {"description": description, "parameters": [_parameter(field) for field in fields]}


def _parameter(field: dataclasses.Field[object]) -> dict[str, Any]:
    meta = field.metadata
    default = field.default if field.default is not dataclasses.MISSING else None
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    options = meta.get("options")
    return {
        "name": field.name,
        "required": field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING,
        "default": list(default) if isinstance(default, tuple) else default,
        "unit": meta.get("unit", ""),
        "low": meta.get("low"),
        "high": meta.get("high"),
        "options": list(options) if options else None,
        "place": "location" in meta,
        "help": meta.get("help", ""),
        "origin": meta.get("source", ""),
    }


def _text(effect: dict[str, Any], *, whole: bool) -> str:
    if whole:
        lines = [effect["name"], textwrap.indent(effect["description"], "  "), ""]
    else:
        summary = " ".join(effect["description"].split("\n\n")[0].split())
        lines = [textwrap.fill(f"{effect['name']}: {summary}", _WIDTH, subsequent_indent="  ")]
    column = max((len(parameter["name"]) for parameter in effect["parameters"]), default=0)
    indent = " " * (column + 4)
    for parameter in effect["parameters"]:
        bounds = bounds_text(parameter)
        lines.append(
            f"  {parameter['name']:<{column}}  {value_text(parameter)}{f'   {bounds}' if bounds else ''}"
        )
        note = (
            f"{parameter['help']} (origin: {parameter['origin']})"
            if parameter["origin"]
            else parameter["help"]
        )
        lines.append(textwrap.fill(note, _WIDTH, initial_indent=indent, subsequent_indent=indent))
    return "\n".join(lines)


def value_text(parameter: dict[str, Any]) -> str:
    """Return the default with its unit, or that the parameter is required."""
    words = ["required"] if parameter["required"] else [_short(parameter["default"])]
    if parameter["place"]:
        words.append("(a point's name, node_<layer>_<i>_<j>, or [layer, i, j])")
    return " ".join([*words, parameter["unit"]]).strip()


def bounds_text(parameter: dict[str, Any]) -> str:
    """Return what is accepted; '' for anything."""
    if parameter["options"]:
        return f"one of {' | '.join(map(str, parameter['options']))}"
    low, high = parameter["low"], parameter["high"]
    below, above = low is not None and math.isfinite(low), high is not None and math.isfinite(high)
    if below and above:
        return f"{low:g} ... {high:g}"
    return f"at least {low:g}" if below else f"at most {high:g}" if above else ""


def _short(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_short(item) for item in value)}]"
    return f"{value:g}" if isinstance(value, float) else "none" if value is None else str(value)

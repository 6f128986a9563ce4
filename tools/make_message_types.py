"""Writes ldcs_ros/messages/ros_types.py: the fields of the ROS 2 types that the twin sends and receives."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from ldcs_ros.messages.ros_types import TYPES

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

PATH = Path(__file__).resolve().parents[1] / "ldcs_ros/messages/ros_types.py"


def main() -> None:
    """Write the file: its own text up to the table, and the table."""
    known = get_typestore(Stores.ROS2_KILTED).fielddefs
    lines: dict[str, str] = {}
    pending = list(TYPES)
    while pending:
        name = pending.pop()
        if name not in lines:
            constants, fields = known[name]
            written = [f"{kind} {field}={value!r}" for field, kind, value in constants]
            for field, description in fields:
                kind, nested = spelled(description)
                written.append(f"{kind} {field}")
                pending += nested
            lines[name] = ", ".join(written)
    before = PATH.read_text(encoding="utf-8").partition("_TABLE = ")[0]
    table = "\n".join(
        "\n".join(textwrap.wrap(f"{name}: {lines[name]}", 116, subsequent_indent="    "))
        for name in sorted(lines)
    )
    PATH.write_text(f'{before}_TABLE = """\n{table}\n"""\n', encoding="utf-8")


def spelled(description: FieldDesc) -> tuple[str, list[str]]:
    """Return a field's type as in a .msg file, and the names of types nested in it."""
    kind, value = description
    if kind == Nodetype.BASE:
        return f"{value[0]}<={value[1]}" if value[1] else value[0], []
    if kind == Nodetype.NAME:
        return value, [value]
    inner, nested = spelled(value[0])
    if kind == Nodetype.SEQUENCE and value[1]:
        return f"{inner}[<={value[1]}]", nested
    return f"{inner}[{value[1] or ''}]", nested


if __name__ == "__main__":
    main()

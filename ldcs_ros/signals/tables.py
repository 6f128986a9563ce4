"""A table (CSV, Parquet) as a Recording: each mapped group of columns is a topic, each row a message of it.

Units, frames and arms are the mapping's, as for the topics of a rig's bag. A row without a number in one of its cells
has no message on that topic.
"""

from __future__ import annotations

import os
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np

from ldcs_ros.bags import Message, Recording, read_bag
from ldcs_ros.bags.reader import STORAGE_SUFFIXES
from ldcs_ros.errors import MappingError, RecordingError
from ldcs_ros.schema.fields import did_you_mean
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals.mapping import COMMANDS, CommandSource, Mapping, MeasurementSource, parse_mapping
from ldcs_ros.tables.read import NO_TIME, TableFile, is_table, open_table
from ldcs_ros.tables.read import SUFFIXES as TABLES

_SCALAR, _POINT, _VECTOR, _ARRAY = (
    "std_msgs/msg/Float64",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Vector3",
    "std_msgs/msg/Float64MultiArray",
)
_CDR = b"\0\1\0\0"  # little-endian
_WITH_UNIT = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]$")
_TIMES = ("time", "t", "timestamp")


def open_recording(path: str | os.PathLike[str], mapping: Mapping | None) -> tuple[Recording, Mapping | None]:
    """Return the recording of a bag or a table, and its mapping.

    Args:
        path: Bag folder, .mcap, .db3, .csv, .tsv or .parquet file.
        mapping: Meaning of its topics or columns; None to go by their names.

    Returns:
        The recording, and the mapping that was given; for a table without one the mapping that its names suggest.

    Raises:
        RecordingError: It cannot be read, or a column is missing or holds something else than numbers.
        MappingError: The mapping is not for a table, or the names of the columns do not say enough.
        MissingPackageError: The package for its format is not installed.
    """
    file = Path(path)
    if not is_table(file):
        if mapping is not None and mapping.time_column is not None:
            raise MappingError(
                f"{file} is a bag, and the mapping is for a table; name topics in place of columns"
            )
        if file.is_file() and file.suffix not in STORAGE_SUFFIXES:
            raise RecordingError(
                f"{file} is no table ({', '.join(TABLES)}) and no bag (a folder, {', '.join(STORAGE_SUFFIXES)}); "
                "save a spreadsheet as CSV"
            )
        return read_bag(file), mapping
    table = open_table(file)
    meaning = mapping or guess_columns(table)
    return _recording(table, meaning), meaning


def guess_columns(table: TableFile) -> Mapping:
    """Return the mapping that the names of columns suggest.

    Names are those that `ldcs export` writes, with their units in brackets: `time [s]`, `P1.x [m]` with or without y
    and z, `left/pressure [Pa]`, `joint/NAME [rad]`, `pressure_command.left [Pa]`.

    Raises:
        MappingError: There is no column of times, or nothing else is known.
    """
    named = {name: _split(name) for name in table.names}
    commands: list[object] = []
    measurements: list[object] = []
    time: dict[str, object] | None = None
    for column, (name, unit) in named.items():
        said: dict[str, object] = {"unit": unit} if unit else {}
        start, _, end = name.rpartition(".")
        if name.lower() in _TIMES and time is None:
            time = {"column": column, **said}
        elif name in COMMANDS and name != "external_wrench":
            commands.append({"columns": [column], "to": name, **said})
        elif start == "pressure_command":
            commands.append({"columns": [column], "to": start, "arms": [end], **said})
        elif name.endswith("/pressure") or name.startswith("joint/"):
            measurements.append({"columns": [column], "to": name, **said})
        elif end in AXES and start.isidentifier():
            group = [
                other for axis in AXES for other, known in named.items() if known == (f"{start}.{axis}", unit)
            ]
            if len(group) != 3:
                measurements.append({"columns": [column], "to": name, **said})
            elif column == group[0]:
                measurements.append({"columns": group, "to": start, **said})
    if time is None or not commands + measurements:
        raise MappingError(
            f"{table.name} has the columns {list(table.names[:30])}; say what they mean, for example "
            "--columns time=t:ms pressure_command=p1,p2:kPa P1=x,y,z:mm, or with a mapping file (--map)"
        )
    # An exported table has the commands at their times; what acted before the first one is not in it.
    content = {"time": time, "initial": "rest", "commands": commands, "measurements": measurements}
    return parse_mapping(content)


def columns_mapping(words: list[str]) -> Mapping:
    """Return the mapping of `NAME=COLUMN[,COLUMN...][:UNIT]` words.

    NAME is `time`, `pressure_command` (all arms), `pressure_command.ARM`, `torque_command`,
    `external_wrench.FRAME`, a point, a coordinate `POINT.AXIS`, `ARM/pressure` or `joint/NAME`; `initial=start` is a
    mapping file's.

    Raises:
        MappingError: A word is not of this form, or a name or unit is not known.
    """
    content: dict[str, object] = {}
    commands: list[object] = []
    measurements: list[object] = []
    for word in words:
        name, equals, rest = word.partition("=")
        text, _, unit = rest.rpartition(":") if ":" in rest else (rest, "", "")
        columns: list[object] = [column.strip() for column in text.split(",")]
        if not equals or not all(columns):
            raise MappingError(f"got {word!r}, expected NAME=COLUMN,...:UNIT such as P1=x,y,z:mm @ --columns")
        said: dict[str, object] = {"unit": unit} if unit else {}
        target, _, place = name.partition(".")
        if name == "initial":
            content["initial"] = rest
        elif name == "time":
            content["time"] = {"column": text.strip(), **said}
        elif target in COMMANDS:
            key = "frame" if target == "external_wrench" else "arms"
            where: dict[str, object] = {key: place if key == "frame" else [place]} if place else {}
            commands.append({"columns": columns, "to": target, **where, **said})
        else:
            if name.isidentifier() and len(columns) != 3:
                raise MappingError(
                    f"got {word!r}: a point has the columns of x, y and z, one coordinate of it is {name}.z=COLUMN."
                    f"{did_you_mean(name, [*COMMANDS, 'time', 'initial'])} @ --columns"
                )
            measurements.append({"columns": columns, "to": name, **said})
    if "time" not in content:
        raise MappingError("got no column of times, expected one such as time=t:ms @ --columns")
    try:
        return parse_mapping({**content, "commands": commands, "measurements": measurements})
    except MappingError as error:
        raise MappingError(f"{error} of --columns") from error


def _split(name: str) -> tuple[str, str]:
    match = _WITH_UNIT.match(name)
    return (name, "") if match is None else (match["name"], match["unit"].strip())


def _recording(table: TableFile, mapping: Mapping) -> Recording:
    if mapping.time_column is None:
        raise MappingError(f"{table.name} is a table; its mapping needs time: {{column: NAME}} and columns")
    times = table.times(mapping.time_column.column, mapping.time_column.scale)
    timed = times != NO_TIME
    notes = []
    if (~timed).any():
        notes.append(f"{int((~timed).sum())} rows without a time are left out")
    if (np.diff(times[timed]) < 0).any():
        notes.append(
            f"{int((np.diff(times[timed]) < 0).sum())} rows before the time of the row above are sorted"
        )
    types: dict[str, str] = {}
    groups: dict[str, tuple[str, ...]] = {}
    sources: tuple[CommandSource | MeasurementSource, ...] = (*mapping.commands, *mapping.measurements)
    for source in sources:
        kind = _message_type(source.to, len(source.columns))
        # One column may be a command and a measurement; both read the same numbers.
        if types.setdefault(source.topic, kind) != kind:
            raise MappingError(
                f"the columns {source.topic} are named for {source.to} and for something else, too"
            )
        groups[source.topic] = source.columns
    messages = []
    for topic, columns in groups.items():
        values = np.column_stack([table.column(column) for column in columns]).astype("<f8")
        whole = timed & np.isfinite(values).all(axis=1)
        if not whole.any():
            raise RecordingError(
                f"{table.name} has no row with a number in each of the columns {list(columns)}"
            )
        head = _CDR + (struct.pack("<IIII", 0, 0, len(columns), 0) if types[topic] == _ARRAY else b"")
        messages += [
            Message(topic, types[topic], head + row.tobytes(), time)
            for row, time in zip(values[whole], times[whole].tolist(), strict=True)
        ]
    # A row counts as recorded, also one whose cells are empty.
    made = Recording.from_messages(messages, name=table.name)
    return replace(made, start=int(times[timed].min()), end=int(times[timed].max()), notes=tuple(notes))


def _message_type(to: str, count: int) -> str:
    if to in ("pressure_command", "torque_command"):
        return _ARRAY if count > 1 else _SCALAR
    if to == "external_wrench":
        return _VECTOR
    return _POINT if count == 3 else _SCALAR

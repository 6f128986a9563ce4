"""The mapping file (YAML) of a rig, read and checked key by key.

time: log                      # a message acts when it was recorded; `stamp`: when its header says;
                               # without it commands act when they were recorded, measurements hold at their stamp
initial: rest                  # a replay begins at rest without commands; `held`: at rest under the first commands;
                               # `start`: at the scene's start. A table, whose columns hold commands, begins `held`
late: 0.1                      # s; later than that after its stamp, a message counts as late
gap: 0.5                       # s; a longer silence counts as missing messages
ambient_pressure: 101325       # Pa
commands:
  - {topic: /valves/setpoint, to: pressure_command, unit: mbar, arms: [right, left]}
  - {topic: /left_valve, to: pressure_command, unit: psi, arms: [left], field: fluid_pressure, absolute: false}
  - {topic: /push, to: external_wrench, frame: P1_aligned, unit: N}
measurements:
  - {topic: /trakstar_msg, to: P0, child: trakstar0, unit: mm, translation: [0.05, 0, 0], rotation: [0, 0, 0, 1]}
  - {topic: /gauges, to: left/pressure, unit: psi, index: 0}
  - {topic: /laser, to: P1.z, unit: mm, translation: [0, 0, 0.4], rotation: [1, 0, 0, 0]}   # looks down from 0.4 m

A table (CSV, Parquet) has columns in place of topics, and a column of times:

time: {column: t, unit: ms}    # s if not said; dates (ISO 8601) need no unit
commands:
  - {columns: [p_left, p_right], to: pressure_command, unit: kPa, arms: [left, right]}
measurements:
  - {columns: [x, y, z], to: P1, unit: mm, translation: [0.05, 0, 0], rotation: [0, 0, 0, 1]}
  - {columns: [p_measured], to: left/pressure, unit: kPa, absolute: true}
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.errors import MappingError
from ldcs_ros.schema.checks import Checks
from ldcs_ros.schema.reader import read_text, read_yaml
from ldcs_ros.schema.units import AXES, PRESSURE, STANDARD_ATMOSPHERE

TORQUE = {"N m": 1.0, "mN m": 1e-3}
FORCE = {"N": 1.0, "mN": 1e-3}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "inch": 0.0254}
ANGLE = {"rad": 1.0, "deg": 0.017453292519943295}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}

# Command -> the units that it may come in.
COMMANDS = {
    "pressure_command": PRESSURE,
    "torque_command": TORQUE,
    "external_wrench": FORCE,
}
_CHECKS = Checks(MappingError)
_TOP = ("time", "initial", "late", "gap", "ambient_pressure", "commands", "measurements")
_COMMAND = ("topic", "columns", "to", "unit", "field", "arms", "joints", "frame", "absolute")
_MEASUREMENT = (
    "topic",
    "columns",
    "to",
    "unit",
    "field",
    "child",
    "translation",
    "rotation",
    "absolute",
    "index",
)


@dataclass(frozen=True)
class CommandSource:
    """A topic, or columns of a table, that command the rig.

    Attributes:
        topic: Its name in the bag; the names of the columns with commas between.
        to: Corresponding input of the twin: pressure_command, torque_command or external_wrench.
        scale: Factor from its unit to SI.
        field: Path of the value in the message, '' for the usual one of the type.
        arms: Arms that its values are for, in their order; empty for all arms of the scene in its order.
        joints: Joint names for its values, in their order; empty to take the message's own.
        frame: Frame of a wrench; '' to take the message's own.
        offset: Subtracted from the value in SI, such as the ambient pressure from absolute ones; None for that
            of the message type.
        columns: Columns of a table, one for each number of a message; () for a topic.
    """

    topic: str
    to: str
    scale: float = 1.0
    field: str = ""
    arms: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    frame: str = ""
    offset: float | None = None
    columns: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasurementSource:
    """A topic, or columns of a table, that report a measurement.

    Attributes:
        topic: Its name in the bag; the names of the columns with commas between.
        to: The measured quantity: a point (`P0`), one coordinate of it (`P1.z`), `<arm>/pressure`, or a joint
            (`joint/<name>`).
        scale: Factor from its unit to SI.
        field: Path of the value in the message, '' for the usual one of the type.
        child: Child frame of the transform that is meant; '' for any.
        translation: Position of the sensor's base in ldcs_base [m]; of a coordinate its own component counts.
        rotation: Unit quaternion x, y, z, w that rotates the sensor's axes into those of ldcs_base.
        offset: Subtracted from the value in SI, such as the ambient pressure from absolute ones; None for that
            of the message type.
        index: Index of the element of an array; None for a message with one value.
        columns: Columns of a table, one for each number of a message; () for a topic.
    """

    topic: str
    to: str
    scale: float = 1.0
    field: str = ""
    child: str = ""
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    offset: float | None = None
    index: int | None = None
    columns: tuple[str, ...] = ()

    @property
    def axis(self) -> int | None:
        """Index of the coordinate that it measures; None for other quantities."""
        return AXES.index(self.to[-1]) if "." in self.to and not self.to.startswith("joint/") else None

    def in_base(self, place: np.ndarray) -> np.ndarray:
        """Return a place in the sensor's axes [m], shape (3,), in ldcs_base [m]."""
        axis, scalar = np.asarray(self.rotation[:3]), self.rotation[3]
        across = np.cross(axis, place)
        rotated: np.ndarray = place + 2.0 * (scalar * across + np.cross(axis, across))
        return np.asarray(self.translation) + rotated


@dataclass(frozen=True)
class TimeColumn:
    """The column of a table that has the times.

    Attributes:
        column: Its name.
        scale: Factor from its unit to seconds.
    """

    column: str
    scale: float = 1.0


@dataclass(frozen=True)
class Mapping:
    """The meaning of a bag's topics, or of a table's columns.

    Attributes:
        commands: Topics that command.
        measurements: Topics that report.
        time: Time at which a message acts: 'log' (its recording) or 'stamp' (its header); None: commands by log,
            measurements by stamp.
        initial: Begin of a replay: 'rest' (the equilibrium without commands), 'held' (the equilibrium under the
            commands of the first instant), or 'start' (the scene's start).
        late: Delay from stamp to recording above which a message counts as late [s].
        gap: Silence above which messages count as missing [s]; None for five of the topic's usual periods.
        ambient_pressure: Pressure of the surrounding air [Pa].
        time_column: Times of a table's rows; None for a bag.
    """

    commands: tuple[CommandSource, ...] = ()
    measurements: tuple[MeasurementSource, ...] = ()
    time: str | None = None
    initial: str = "rest"
    late: float = 0.1
    gap: float | None = None
    ambient_pressure: float = STANDARD_ATMOSPHERE
    time_column: TimeColumn | None = None


def load_mapping(path: str | os.PathLike[str]) -> Mapping:
    """Return the mapping of a file.

    Raises:
        MappingError: It cannot be read, is not valid YAML, or a key or value is wrong; the message names it.
    """
    file = Path(path)
    text = read_text(file, "mapping file", MappingError)
    content = read_yaml(text, origin=file.name, error=MappingError)
    try:
        return parse_mapping(content)
    except MappingError as error:
        raise MappingError(f"{error} @ {file.name}") from error


def parse_mapping(content: object) -> Mapping:
    """Return the mapping of a file's content.

    Raises:
        MappingError: A key or value is wrong; the message names it.
    """
    block = _CHECKS.keys(content, _TOP, "the mapping")
    ambient = _CHECKS.number(block.get("ambient_pressure", STANDARD_ATMOSPHERE), "ambient_pressure", low=0.0)
    commands = tuple(
        _command(entry, f"commands[{k}]", ambient)
        for k, entry in enumerate(_CHECKS.items(block.get("commands") or [], "commands"))
    )
    measurements = tuple(
        _measurement(entry, f"measurements[{k}]", ambient)
        for k, entry in enumerate(_CHECKS.items(block.get("measurements") or [], "measurements"))
    )
    if not commands and not measurements:
        raise MappingError("nothing is mapped; name topics under commands or measurements")
    gap = block.get("gap")
    time = block.get("time")
    time_column = _time_column(time) if isinstance(time, dict) else None
    _check_places(commands, "commands", time_column)
    _check_places(measurements, "measurements", time_column)
    _check_once(measurements)
    return Mapping(
        commands=commands,
        measurements=measurements,
        time=_CHECKS.choice(time, ("log", "stamp"), "time") if "time" in block and not time_column else None,
        initial=_CHECKS.choice(
            block.get("initial", "held" if time_column else "rest"), ("rest", "held", "start"), "initial"
        ),
        late=_CHECKS.number(block.get("late", 0.1), "late", low=0.0),
        gap=None if gap is None else _CHECKS.number(gap, "gap", low=1e-9),
        ambient_pressure=ambient,
        time_column=time_column,
    )


def _check_places(
    sources: Sequence[CommandSource | MeasurementSource], name: str, time_column: TimeColumn | None
) -> None:
    for k, source in enumerate(sources):
        if source.columns and time_column is None:
            raise MappingError(
                f"got columns, expected a topic, or time: {{column: NAME}} for a table @ {name}[{k}]"
            )
        if not source.columns and time_column is not None:
            raise MappingError(
                f"got a topic, expected columns, as time names a column of a table @ {name}[{k}]"
            )


def _time_column(block: dict[str, Any]) -> TimeColumn:
    _CHECKS.keys(block, ("column", "unit"), "time", required=("column",))
    return TimeColumn(
        _CHECKS.text(block["column"], "time.column"), _unit(block.get("unit"), TIME, "time.unit")
    )


def _source(block: dict[str, Any], path: str, count: int | None) -> tuple[str, tuple[str, ...]]:
    """Return the topic and the columns of an entry, which has one of the two; `count` columns, None for any number."""
    if ("topic" in block) == ("columns" in block):
        raise MappingError(f"got {sorted(block)}, expected either topic or columns @ {path}")
    if "topic" in block:
        return _CHECKS.text(block["topic"], f"{path}.topic"), ()
    for key in ("field", "child", "index"):
        if key in block:
            raise MappingError(f"got {key}, which is of messages, beside columns; name each column @ {path}")
    columns = tuple(
        _CHECKS.text(column, f"{path}.columns")
        for column in _CHECKS.items(block["columns"], f"{path}.columns")
    )
    if not columns or (count is not None and len(columns) != count):
        raise MappingError(f"got {len(columns)} columns, expected {count or 'one or more'} @ {path}.columns")
    return ",".join(columns), columns


def _command(entry: object, path: str, ambient: float) -> CommandSource:
    block = _CHECKS.keys(entry, _COMMAND, path, required=("to",))
    to = _CHECKS.choice(block["to"], COMMANDS, f"{path}.to")
    topic, columns = _source(block, path, 3 if to == "external_wrench" else None)
    if columns and to == "external_wrench" and "frame" not in block:
        raise MappingError(
            f"got no frame, expected the one that the force acts at, such as P1_aligned @ {path}.frame"
        )
    arms = tuple(
        _CHECKS.text(arm, f"{path}.arms") for arm in _CHECKS.items(block.get("arms", []), f"{path}.arms")
    )
    if ("arms" in block and not arms) or len(set(arms)) != len(arms):
        raise MappingError(f"got {list(arms)}, expected one or more different arms @ {path}.arms")
    return CommandSource(
        topic=topic,
        to=to,
        scale=_unit(block.get("unit"), COMMANDS[to], f"{path}.unit"),
        field=_CHECKS.text(block.get("field", ""), f"{path}.field"),
        arms=arms,
        joints=tuple(
            _CHECKS.text(name, f"{path}.joints")
            for name in _CHECKS.items(block.get("joints", []), f"{path}.joints")
        ),
        frame=_CHECKS.text(block.get("frame", ""), f"{path}.frame"),
        offset=_offset(block, path, ambient),
        columns=columns,
    )


def _measurement(entry: object, path: str, ambient: float) -> MeasurementSource:
    block = _CHECKS.keys(entry, _MEASUREMENT, path, required=("to",))
    to = _CHECKS.text(block["to"], f"{path}.to")
    arm, _, quantity = to.partition("/")
    if arm.isidentifier() and quantity == "pressure":
        known = PRESSURE
    elif to.startswith("joint/"):
        known = ANGLE
    elif to.isidentifier() or (to[:-2].isidentifier() and to[-2] == "." and to[-1] in AXES):
        known = LENGTH
    else:
        raise MappingError(
            f"got {to!r}, expected a point such as P0, a coordinate such as P1.z, ARM/pressure such as left/pressure, "
            f"or joint/NAME @ {path}.to"
        )
    topic, columns = _source(block, path, 3 if to.isidentifier() else 1)
    index = block.get("index")
    if index is not None:
        index = _CHECKS.whole(index, f"{path}.index", low=0)
    translation = _CHECKS.numbers(block.get("translation", [0.0] * 3), 3, f"{path}.translation")
    rotation = _CHECKS.numbers(block.get("rotation", [0.0, 0.0, 0.0, 1.0]), 4, f"{path}.rotation")
    length = math.hypot(*rotation)
    if not 0.99 < length < 1.01:
        raise MappingError(f"got {list(rotation)}, expected a unit quaternion [x, y, z, w] @ {path}.rotation")
    x, y, z, w = (part / length for part in rotation)
    source = MeasurementSource(
        topic=topic,
        to=to,
        scale=_unit(block.get("unit"), known, f"{path}.unit"),
        field=_CHECKS.text(block.get("field", ""), f"{path}.field"),
        child=_CHECKS.text(block.get("child", ""), f"{path}.child"),
        translation=(translation[0], translation[1], translation[2]),
        rotation=(x, y, z, w),
        offset=_offset(block, path, ambient),
        index=index,
        columns=columns,
    )
    axis = source.axis
    if axis is not None:
        unit_vector = np.eye(3)[axis]
        if abs((source.in_base(unit_vector) - source.in_base(0.0 * unit_vector))[axis]) < 0.9999:
            raise MappingError(
                f"got {list(rotation)}, expected a rotation that keeps or reverses the axis of {to} @ {path}.rotation"
            )
    return source


def _check_once(measurements: Sequence[MeasurementSource]) -> None:
    """Refuse two measurements of one coordinate, of which a report could show one alone."""
    seen: set[str] = set()
    for k, source in enumerate(measurements):
        names = {f"{source.to}.{axis}" for axis in AXES} if source.to.isidentifier() else {source.to}
        if names & seen:
            raise MappingError(f"got {source.to} twice, expected one source for it @ measurements[{k}].to")
        seen |= names


def _offset(block: dict[str, Any], path: str, ambient: float) -> float | None:
    absolute = block.get("absolute")
    if absolute is None:
        return None
    return ambient if _CHECKS.truth(absolute, f"{path}.absolute") else 0.0


def _unit(value: object, known: dict[str, float], path: str) -> float:
    # Without a unit a value is in SI: the first of each table.
    return known[next(iter(known)) if value is None else _CHECKS.choice(value, known, path)]

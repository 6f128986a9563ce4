"""The mapping file (YAML) of a rig, read and checked key by key.

time: log                      # a message acts when it was recorded; `stamp`: when its header says
initial: rest                  # a replay begins at rest without commands; `start`: at the scene's start
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
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from ldcs_ros.errors import MappingError
from ldcs_ros.schema.reader import Checks
from ldcs_ros.signals import units
from ldcs_ros.signals.sources import CommandSource, Mapping, MeasurementSource

ARMS = ("left", "right")
# Command -> the units that it may come in.
COMMANDS = {
    "pressure_command": units.PRESSURE,
    "torque_command": units.TORQUE,
    "external_wrench": units.FORCE,
}
_CHECKS = Checks(MappingError)
_TOP = ("time", "initial", "late", "gap", "ambient_pressure", "commands", "measurements")
_COMMAND = ("topic", "to", "unit", "field", "arms", "joints", "frame", "absolute")
_MEASUREMENT = ("topic", "to", "unit", "field", "child", "translation", "rotation", "absolute", "index")


def load_mapping(path: str | os.PathLike[str]) -> Mapping:
    """Return the mapping of a file.

    Raises:
        MappingError: It cannot be read, is no YAML, or a key or value is wrong; the message says which.
    """
    file = Path(path)
    content = _CHECKS.content(_CHECKS.read(file, "mapping file"), str(file))
    try:
        return parse_mapping(content)
    except MappingError as error:
        raise MappingError(f"{error} @ {file.name}") from error


def parse_mapping(content: Any) -> Mapping:
    """Return the mapping of a file's content.

    Raises:
        MappingError: A key or value is wrong; the message says which.
    """
    block = _CHECKS.keys(content, _TOP, "the mapping")
    ambient = _CHECKS.number(
        block.get("ambient_pressure", units.STANDARD_ATMOSPHERE), "ambient_pressure", low=0.0
    )
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
    return Mapping(
        commands=commands,
        measurements=measurements,
        time=_CHECKS.choice(block.get("time", "log"), ("log", "stamp"), "time"),
        initial=_CHECKS.choice(block.get("initial", "rest"), ("rest", "start"), "initial"),
        late=_CHECKS.number(block.get("late", 0.1), "late", low=0.0),
        gap=None if gap is None else _CHECKS.number(gap, "gap", low=1e-9),
        ambient_pressure=ambient,
    )


def _command(entry: Any, path: str, ambient: float) -> CommandSource:
    block = _CHECKS.keys(entry, _COMMAND, path, required=("topic", "to"))
    to = _CHECKS.choice(block["to"], COMMANDS, f"{path}.to")
    arms = tuple(
        _CHECKS.choice(arm, ARMS, f"{path}.arms")
        for arm in _CHECKS.items(block.get("arms", list(ARMS)), f"{path}.arms")
    )
    if not arms or len(set(arms)) != len(arms):
        raise MappingError(f"got {list(arms)}, expected one or two different arms @ {path}.arms")
    return CommandSource(
        topic=_CHECKS.text(block["topic"], f"{path}.topic"),
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
    )


def _measurement(entry: Any, path: str, ambient: float) -> MeasurementSource:
    block = _CHECKS.keys(entry, _MEASUREMENT, path, required=("topic", "to"))
    to = _CHECKS.text(block["to"], f"{path}.to")
    if to in (f"{arm}/pressure" for arm in ARMS):
        known = units.PRESSURE
    elif to.startswith("joint/"):
        known = units.ANGLE
    elif to.isidentifier():
        known = units.LENGTH
    else:
        raise MappingError(
            f"got {to!r}, expected a point such as P0, left/pressure, right/pressure or joint/NAME @ {path}.to"
        )
    index = block.get("index")
    if index is not None and (isinstance(index, bool) or not isinstance(index, int) or index < 0):
        raise MappingError(f"got {index!r}, expected a whole number, 0 or above @ {path}.index")
    translation = _CHECKS.numbers(block.get("translation", [0.0] * 3), 3, f"{path}.translation")
    rotation = _CHECKS.numbers(block.get("rotation", [0.0, 0.0, 0.0, 1.0]), 4, f"{path}.rotation")
    length = math.hypot(*rotation)
    if not 0.99 < length < 1.01:
        raise MappingError(f"got {list(rotation)}, expected a unit quaternion [x, y, z, w] @ {path}.rotation")
    x, y, z, w = (part / length for part in rotation)
    return MeasurementSource(
        topic=_CHECKS.text(block["topic"], f"{path}.topic"),
        to=to,
        scale=_unit(block.get("unit"), known, f"{path}.unit"),
        field=_CHECKS.text(block.get("field", ""), f"{path}.field"),
        child=_CHECKS.text(block.get("child", ""), f"{path}.child"),
        translation=(translation[0], translation[1], translation[2]),
        rotation=(x, y, z, w),
        offset=_offset(block, path, ambient),
        index=index,
    )


def _offset(block: dict[str, Any], path: str, ambient: float) -> float | None:
    absolute = block.get("absolute")
    if absolute is None:
        return None
    if not isinstance(absolute, bool):
        raise MappingError(f"got {absolute!r}, expected true or false @ {path}.absolute")
    return ambient if absolute else 0.0


def _unit(value: Any, known: dict[str, float], path: str) -> float:
    # Without a unit a value is in SI: the first of each table.
    return known[next(iter(known)) if value is None else _CHECKS.choice(value, known, path)]

"""The rig file: limits and links of one rig as YAML, checked; every error is one line with the path of the key."""

from __future__ import annotations

import dataclasses
import importlib.resources
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ldcs_ros.errors import BridgeError, user_path
from ldcs_ros.rig.limits import BOUNDS, Limits
from ldcs_ros.rig.link import Link
from ldcs_ros.rig.output.modbus import ModbusMap
from ldcs_ros.rig.output.serial_line import SerialSettings
from ldcs_ros.rig.output_link import OutputLink
from ldcs_ros.rig.reading import KINDS
from ldcs_ros.rig.rig_check import LinkSettings, check_rig
from ldcs_ros.rig.topic_link import JOINT_FIELDS, Incoming, Outgoing, TopicLink, TopicSettings
from ldcs_ros.rig.units import PressureUnit
from ldcs_ros.schema.checks import Checks
from ldcs_ros.schema.reader import plain_values, read_text, read_yaml, write_yaml
from ldcs_ros.schema.units import ARM_NAMES

TOPIC_PROGRAM = "ldcs_ros.ros.rig.topic_output"  # started by name: this room imports no rclpy
LINK_TYPES = ("modbus", "serial", "topics")
_T = TypeVar("_T")
_Wire = TypeVar("_Wire", ModbusMap, SerialSettings)
_CHECKS = Checks(BridgeError)
_UNIT_KEYS = ("unit", "reference", "ambient")


@dataclass(frozen=True)
class RigFile:
    """The content of a rig file.

    Attributes:
        title: One line for people.
        limits: Limits of every command.
        links: Settings of each link.
        text: The file itself, for bags.
    """

    title: str
    limits: Limits
    links: tuple[LinkSettings, ...]
    text: str

    def connect(self, clock: Callable[[], float], *, commands: bool) -> list[Link]:
        """Return the links, not yet started.

        Args:
            clock: Steady clock [s].
            commands: Whether set-points are to go to the rig.
        """
        return [link for settings in self.links for link in _links(settings, self.limits, clock, commands)]

    @property
    def takes_setpoints(self) -> bool:
        """Whether a link of the file takes set-points."""
        return any(not isinstance(one, TopicSettings) or one.send is not None for one in self.links)


def shipped_rigs() -> dict[str, Path]:
    """Return the shipped rig files by name."""
    folder = Path(str(importlib.resources.files("ldcs_ros"))) / "rig" / "rigs"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_rig(source: str | os.PathLike[str] | dict[str, Any]) -> RigFile:
    """Return the rig of a shipped name, a YAML file or a dict with the same keys.

    Raises:
        BridgeError: It cannot be found, read or understood.
    """
    if isinstance(source, dict):
        content = plain_values(source, origin="the rig", error=BridgeError)
        return _rig(content, write_yaml(content))
    path = shipped_rigs().get(str(source), user_path(source))
    if not os.path.exists(path):  # Path.exists fails at names that no file can have
        raise BridgeError(f"no rig {str(source)!r}: neither a file nor one of {list(shipped_rigs())}")
    text = read_text(path, "rig file", BridgeError)
    content = read_yaml(text, origin=path.name, error=BridgeError)
    try:
        return _rig(content, text)
    except BridgeError as error:
        raise BridgeError(f"{error} in {path.name}") from error


def _rig(content: object, text: str) -> RigFile:
    block = _CHECKS.keys(content, ("title", "arms", "limits", "links"), "the rig", required=("links",))
    arms = tuple(
        _CHECKS.text(arm, "arms") for arm in _CHECKS.items(block.get("arms", list(ARM_NAMES)), "arms")
    )
    given = _CHECKS.keys(block.get("limits", {}), tuple(BOUNDS), "limits")
    limits = _build(Limits, {**given, "arms": arms}, "limits")
    links = tuple(
        _settings(one, arms, f"links[{index}]")
        for index, one in enumerate(_CHECKS.items(block["links"], "links"))
    )
    if not links:
        raise BridgeError("no link leads to the rig; expected at least one @ links")
    senders = [one for one in links if not isinstance(one, TopicSettings) or one.send is not None]
    if len(senders) > 1:
        raise BridgeError("more than one link takes set-points; leave one of them @ links")
    check_rig(links, limits)
    return RigFile(str(block.get("title", "rig")), limits, links, text)


def _settings(content: object, arms: tuple[str, ...], path: str) -> LinkSettings:
    kind = content.get("type") if isinstance(content, dict) else None
    if kind == "modbus":
        return _plain(ModbusMap, content, path)
    if kind == "serial":
        return _plain(SerialSettings, content, path)
    if kind == "topics":
        block = _CHECKS.keys(content, ("type", "receive", "send", "rate"), path, required=("receive",))
        topics = _CHECKS.items(block["receive"], f"{path}.receive")
        receive = tuple(_incoming(one, arms, f"{path}.receive[{i}]") for i, one in enumerate(topics))
        send = None
        if block.get("send") is not None:
            part = _CHECKS.keys(block["send"], ("topic", *_UNIT_KEYS), f"{path}.send", required=("topic",))
            send = Outgoing(str(part["topic"]), _unit(part, f"{path}.send", "Pa"))
        rate = _CHECKS.number(block.get("rate", 50.0), f"{path}.rate", low=1.0, high=1000.0)
        return TopicSettings(receive, send, rate)
    raise BridgeError(f"got the type {kind!r}, expected one of {list(LINK_TYPES)} @ {path}.type")


def _plain(cls: type[_Wire], content: object, path: str) -> _Wire:
    required = [f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING]
    keys = ("type", *_names(cls), *_UNIT_KEYS)
    block = dict(_CHECKS.keys(content, keys, path, required=required))
    del block["type"]
    unit = _unit(block, path, "mbar")
    block = {key: value for key, value in block.items() if key not in _UNIT_KEYS}
    for field in dataclasses.fields(cls):
        if field.name in block and field.name != "unit":
            value = block[field.name]
            if isinstance(field.default, bool) or field.type == "str":
                block[field.name] = str(value)
            else:
                whole = field.type == "int"
                low = -1.0 if whole else 1e-3
                check = _CHECKS.whole if whole else _CHECKS.number
                block[field.name] = check(value, f"{path}.{field.name}", low=low, high=4e6)
    return _build(cls, {**block, "unit": unit}, path)


def _incoming(content: object, arms: tuple[str, ...], path: str) -> Incoming:
    keys = (*_names(Incoming), *_UNIT_KEYS)
    required = ("topic", "type", "gives", "names")
    block = dict(_CHECKS.keys(content, tuple(dict.fromkeys(keys)), path, required=required))
    gives = _CHECKS.choice(block["gives"], KINDS, f"{path}.gives")
    names = block["names"]
    if not isinstance(names, (list, dict)) or not names:
        raise BridgeError(
            f"got {names!r}, expected names, or a mapping of the rig's names to ours @ {path}.names"
        )
    given = names.items() if isinstance(names, dict) else enumerate(names)
    mapped = {str(theirs): str(ours) for theirs, ours in given}
    if gives != "position" and not set(mapped.values()) <= set(arms):
        raise BridgeError(f"got {sorted(mapped.values())}, expected arms out of {arms} @ {path}.names")
    field = _CHECKS.choice(block.get("field", "effort"), JOINT_FIELDS, f"{path}.field")
    numbers: dict[str, Any] = {
        "age": _CHECKS.number(block.get("age", 0.0), f"{path}.age", low=0.0, high=10.0)
    }
    for key, length in (("origin", 3), ("turn", 4)):
        if key in block:
            numbers[key] = _CHECKS.numbers(block[key], length, f"{path}.{key}", low=-100.0, high=100.0)
    unit = _unit(block, path, "Pa")
    fixed = {"topic": str(block["topic"]), "type": str(block["type"]), "gives": gives}
    return _build(Incoming, {**fixed, "names": mapped, "unit": unit, "field": field, **numbers}, path)


def _unit(block: dict[str, Any], path: str, default: str) -> PressureUnit:
    ambient = _CHECKS.number(block.get("ambient", 101325.0), f"{path}.ambient", low=0.0, high=2e5)
    values = {"name": block.get("unit", default), "reference": block.get("reference", "gauge")}
    return _build(PressureUnit, {**values, "ambient": ambient}, f"{path}.unit")


def _build(cls: type[_T], values: dict[str, Any], path: str) -> _T:
    try:
        return cls(**values)
    except BridgeError as error:
        raise BridgeError(str(error) if " @ " in str(error) else f"{error} @ {path}") from error


def _names(cls: type) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(cls))


def _links(settings: LinkSettings, limits: Limits, clock: Callable[[], float], commands: bool) -> list[Link]:
    if isinstance(settings, ModbusMap):
        has_clock = settings.clock >= 0
        return [
            OutputLink("modbus", "modbus", settings, limits, clock, commands=commands, has_clock=has_clock)
        ]
    if isinstance(settings, SerialSettings):
        return [OutputLink("serial", "serial", settings, limits, clock, commands=commands, has_clock=True)]
    links: list[Link] = [TopicLink(settings.receive, clock)]
    if commands and settings.send is not None:
        links.append(
            OutputLink(
                "topic output", "topics", settings, limits, clock, commands=True, program=TOPIC_PROGRAM
            )
        )
    return links

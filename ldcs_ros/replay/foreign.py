"""The commands of a bag that this project did not write: mapped, put in order, cleaned and counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import RecordingError
from ldcs_ros.mapping import CommandSource, Mapping, MappingError, fields
from ldcs_ros.replay.conversion import converted
from ldcs_ros.replay.intake import Intake

# Stamps that are further than this from the recorder's time are of another clock [ns].
_ANOTHER_CLOCK = 1_000_000_000


@dataclass(frozen=True)
class MappedCommand:
    """A command of a rig, converted when its turn comes: one topic may speak for one arm of two.

    Attributes:
        time: Simulation time at which it acts [ns].
        after: None: whatever the twin does at that time, the command comes behind it, as it does live.
        source: How to read it.
        message: The message object.
        type: Its type.
        intake: Where to count.
        ambient_pressure: Pressure of the surrounding air [Pa].
    """

    time: int
    after: int | None
    source: CommandSource
    message: Any
    type: str
    intake: Intake
    ambient_pressure: float

    def command(self, simulation: Any) -> tuple[str, bytes] | None:
        try:
            return converted(
                self.message,
                self.type,
                self.source,
                simulation,
                self.time,
                self.intake,
                self.ambient_pressure,
            )
        except MappingError as error:
            self.intake.malformed += 1
            self.intake.problem = self.intake.problem or str(error)
            return None

    def refused(self, reason: str) -> None:
        self.intake.refused[reason] += 1


@dataclass(frozen=True)
class _Heard:
    """A message with the time at which it acts [ns], on the recorder's clock."""

    time: int
    cdr: bytes
    message: Any


def mapped_commands(recording: Any, mapping: Mapping) -> tuple[list[MappedCommand], list[Intake], int]:
    """Return the commands by time, what was found in each topic, and the log time of simulation time zero [ns].

    Simulation time begins with the bag.

    Raises:
        MappingError: A mapped topic is not in the bag, or no command is mapped.
    """
    if not mapping.commands:
        raise MappingError(
            f"no topic of {recording.name} is mapped to a command; name one in a mapping file (--map), "
            f"the bag has {sorted(recording.topics)}"
        )
    origin = recording.start
    commands: list[MappedCommand] = []
    intakes: dict[str, Intake] = {}
    for source in mapping.commands:
        if source.topic not in recording.topics:
            raise MappingError(
                f"{recording.name} has no topic {source.topic!r}, only {sorted(recording.topics)}"
            )
        known = intakes.get(source.topic)
        intake = Intake(source.topic)
        heard = _take_in(recording, source.topic, mapping, intake)
        intake = intakes.setdefault(source.topic, intake) if known is None else known
        message_type = recording.topics[source.topic].type
        commands += [
            MappedCommand(
                max(0, one.time - origin),
                None,
                source,
                one.message,
                message_type,
                intake,
                mapping.ambient_pressure,
            )
            for one in heard
        ]
    return sorted(commands, key=lambda command: command.time), list(intakes.values()), origin


def _take_in(recording: Any, topic: str, mapping: Mapping, intake: Intake) -> list[_Heard]:
    """Return the sound messages of a topic by the time at which they act, and count the others."""
    heard: list[_Heard] = []
    logged: list[int] = []
    seen: set[tuple[int, bytes]] = set()
    for raw in recording.channels[topic].raw:
        intake.messages += 1
        try:
            message = recording.decode(raw)
        except RecordingError as error:
            intake.malformed += 1
            intake.problem = intake.problem or str(error)
            continue
        stamp = fields.stamp(message)
        # A copy has the same stamp; where there are no stamps, the same content at the same time.
        key = (raw.time if stamp is None else stamp, raw.cdr)
        if key in seen:
            intake.duplicates += 1
            continue
        seen.add(key)
        heard.append(_Heard(raw.time if stamp is None else stamp, raw.cdr, message))
        logged.append(raw.time)
    return _in_time(heard, np.array(logged, dtype=np.int64), mapping, intake)


def _in_time(heard: list[_Heard], logged: np.ndarray, mapping: Mapping, intake: Intake) -> list[_Heard]:
    if not heard:
        return []
    stamps = np.array([one.time for one in heard], dtype=np.int64)
    ahead = stamps - logged
    if abs(int(np.median(ahead))) > _ANOTHER_CLOCK:
        # The message that came fastest shows best how the two clocks stand.
        offset = int(ahead.max())
        intake.clock_offset = offset * 1e-9
        stamps = stamps - offset
    intake.late = int(np.sum(logged - stamps > mapping.late * 1e9))
    intake.out_of_order = int(np.sum(stamps < np.maximum.accumulate(stamps)))
    times = stamps if mapping.time == "stamp" else logged
    order = np.argsort(times, kind="stable")
    intake.count_gaps(times[order], mapping.gap)
    return [_Heard(int(times[k]), heard[k].cdr, heard[k].message) for k in order]

"""The commands of a bag that this project did not write: mapped, put in order, cleaned and counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ldcs_ros.replay.conversion import converted
from ldcs_ros.signals import CommandSource, Mapping, MappingError
from ldcs_ros.signals.intake import Intake, take_in


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
        # Several sources may read one topic: it is counted once.
        intake = Intake(source.topic)
        heard = take_in(recording, source.topic, intake, by=mapping.time, late=mapping.late, gap=mapping.gap)
        intake = intakes.setdefault(source.topic, intake)
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

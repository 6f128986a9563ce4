"""The commands of a bag that this project wrote, each with its place among the messages of its time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.replay.feed import RecordedCommand, is_counted

COMMANDS = tuple(name for name, topic in TOPICS.items() if topic.direction == "in" and topic.recorded)


@dataclass(frozen=True)
class Timeline:
    """What happened in a run.

    Attributes:
        commands: The commands in log order.
        end: Log time of the last message [ns].
        last: Messages of that time that say where the run stood; None if the bag holds commands alone.
    """

    commands: tuple[RecordedCommand, ...]
    end: int
    last: int | None


def timeline(recording: Any, *, namespace: str, topics: dict[str, Topic]) -> Timeline:
    """Return the commands of a run and where it ended.

    Args:
        recording: The bag.
        namespace: What stands before relative topic names in it.
        topics: The twin's topics by relative name.
    """
    names = {name if name.startswith("/") else f"{namespace}/{name}": name for name in topics}
    reports = {full for full, name in names.items() if is_counted(topics[name])}
    # A bag of which only the commands were kept does not tell what came between them at one time.
    placed = f"{namespace}/nodes" in recording.topics
    commands: list[RecordedCommand] = []
    time, count = -1, 0
    for message in _in_order(recording, names):
        if message.time != time:
            time, count = message.time, 0
        if message.topic in reports:
            count += 1
        elif names[message.topic] in COMMANDS:
            after = count if placed else None
            commands.append(RecordedCommand(time, after, names[message.topic], message.cdr))
    last = count if placed and recording.end == time else None
    return Timeline(tuple(commands), recording.end, last)


def _in_order(recording: Any, names: dict[str, str]) -> Iterator[Any]:
    wanted = sorted(set(names) & set(recording.topics))
    return iter(recording.in_order(wanted)) if wanted else iter(())

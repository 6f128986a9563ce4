"""A bag that a twin recorded: how its run was built, and the commands with their places among the messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ldcs_ros.bags import Message, Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.replay.drive import RecordedCommand, is_counted
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.topics import recorded_scene
from ldcs_ros.twin.recorder import DEFAULT_NAMESPACE
from ldcs_ros.twin.settings import RunSettings, software_versions

COMMANDS = tuple(name for name, topic in TOPICS.items() if topic.direction == "in" and topic.recorded)


@dataclass(frozen=True)
class RecordedRun:
    """The way in which the twin of a bag was built.

    Attributes:
        scene: Its scene, with every default of that time.
        settings: The settings of the run.
        namespace: Prefix of its relative topics in the bag.
        versions: Versions of the software it ran on, by name.
    """

    scene: Scene
    settings: RunSettings
    namespace: str
    versions: dict[str, str]

    @property
    def differing_versions(self) -> tuple[str, ...]:
        """Software whose version differs from the present one, as 'name: then, now version'."""
        return tuple(
            f"{name}: {self.versions.get(name) or 'unknown'}, now {now}"
            for name, now in software_versions().items()
            if self.versions.get(name, "") != now
        )


def recorded_run(recording: Recording) -> RecordedRun | None:
    """Return the way in which a recorded twin was built; None for a bag that no twin recorded.

    Raises:
        RecordingError: The metadata of the bag cannot be read.
        SceneError: The scene is invalid in this version.
    """
    metadata = recording.custom_data
    scene = recorded_scene(recording)
    # A bridge adds the file of its rig to the bag of the rig's measurements.
    if scene is None or "rig" in metadata:
        return None
    try:
        settings = RunSettings.from_metadata(metadata)
    except ValueError as error:
        raise RecordingError(f"the custom_data of {recording.name} cannot be read: {error}") from error
    return RecordedRun(scene, settings, metadata.get("namespace", DEFAULT_NAMESPACE), dict(metadata))


@dataclass(frozen=True)
class Timeline:
    """The commands and the end of a run.

    Attributes:
        commands: The commands in log order.
        end: Log time of the last message [ns].
        last: Counted messages of that time; None if the bag holds commands alone.
    """

    commands: tuple[RecordedCommand, ...]
    end: int
    last: int | None


def timeline(recording: Recording, *, namespace: str, topics: dict[str, Topic]) -> Timeline:
    """Return the commands of a run and its end.

    Args:
        recording: The bag.
        namespace: Prefix of relative topic names in it.
        topics: The twin's topics by relative name.
    """
    names = {name if name.startswith("/") else f"{namespace}/{name}": name for name in topics}
    reports = {full for full, name in names.items() if is_counted(topics[name])}
    # A bag of which only the commands were kept omits the messages between them at one time.
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


def _in_order(recording: Recording, names: dict[str, str]) -> Iterator[Message]:
    wanted = sorted(set(names) & set(recording.topics))
    return iter(recording.in_order(wanted)) if wanted else iter(())

"""The content of an MCAP file, read from its start, and a sound copy of it."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import indent
from typing import IO

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from ldcs_ros.bags.bag_file import SUMMARY_RECORD, BagFile
from ldcs_ros.bags.mcap_file import CUSTOM_DATA_RECORD, McapFile
from ldcs_ros.bags.metadata import (
    ROOT_KEY,
    BagMetadata,
    FileSummary,
    bag_information,
    parse_metadata,
    topic_summary,
)
from ldcs_ros.bags.scan import Scan, read_index
from ldcs_ros.bags.schemas import ROS_DISTRO
from ldcs_ros.errors import RecordingError


@dataclass
class Contents:
    """Everything but the messages themselves.

    Attributes:
        profile: MCAP profile, None when not even the header was there.
        schemas: Schema id -> schema.
        channels: Channel id -> channel.
        counts: Channel id -> messages.
        start: Earliest log time [ns].
        end: Latest log time [ns].
        custom_data: Texts that the recorder stored.
        ros_distro: Distribution that recorded it, '' when the file does not say.
        dropped: Bytes that cannot be used [bytes].
        sound: The file is whole and its index agrees with it.
        known: Places of the chunks that its index names, ascending.
    """

    profile: str | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    start: int = 2**64 - 1
    end: int = 0
    custom_data: dict[str, str] = field(default_factory=dict)
    ros_distro: str = ""
    dropped: int = 0
    sound: bool = False
    known: tuple[int, ...] = ()

    def add(self, record: McapRecord) -> None:
        """Count a record; a message whose channel was lost is dropped."""
        if isinstance(record, Message):
            if record.channel_id not in self.channels:
                self.dropped += len(record.data)
                return
            self.counts[record.channel_id] += 1
            self.start = min(self.start, record.log_time)
            self.end = max(self.end, record.log_time)
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
        elif isinstance(record, Header):
            self.profile = record.profile
        elif isinstance(record, Metadata):
            self._add_metadata(record)

    def _add_metadata(self, record: Metadata) -> None:
        if record.name == CUSTOM_DATA_RECORD:
            self.custom_data = dict(record.metadata)
            self.ros_distro = self.ros_distro or ROS_DISTRO
        elif record.name == SUMMARY_RECORD:
            self.ros_distro = record.metadata.get("ROS_DISTRO", self.ros_distro)
            text = f"{ROOT_KEY}:\n" + indent(record.metadata.get("serialized_metadata", ""), "  ")
            with suppress(RecordingError):
                self.add_bag_metadata(parse_metadata(text, SUMMARY_RECORD))

    def add_bag_metadata(self, metadata: BagMetadata) -> None:
        """Add values of metadata.yaml that the records lack."""
        self.custom_data = self.custom_data or metadata.custom_data
        distro = metadata.content.get("ros_distro")
        self.ros_distro = self.ros_distro or (distro if isinstance(distro, str) else "")

    def summary(self, name: str) -> FileSummary:
        """Return the file as metadata.yaml lists it."""
        topics = tuple(
            topic_summary(c.topic, self._type(c), c.message_encoding, c.metadata, self.counts[c.id])
            for c in self.channels.values()
        )
        return FileSummary(name, self.start if self.counts.total() else 0, self.end, topics)

    def schema(self, channel: Channel) -> tuple[str, str, bytes] | None:
        """Return name, encoding and text of a channel's schema."""
        schema = self.schemas.get(channel.schema_id)
        return (schema.name, schema.encoding, schema.data) if schema else None

    def _type(self, channel: Channel) -> str:
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""


def read_contents(
    path: Path, stream: IO[bytes], size: int, progress: Callable[[int], None] | None = None
) -> Contents:
    """Read a file of some length [bytes] once and compare it with its own index."""
    index = read_index(stream, size)
    contents = Contents(schemas=dict(index.schemas), channels=dict(index.channels), known=index.chunks)
    stream.seek(0)
    scan = Scan(stream, size, progress, contents.known)
    for record in scan:
        contents.add(record)
    contents.dropped += scan.dropped
    contents.sound = scan.finished and not contents.dropped and _index_agrees(path, contents)
    return contents


def write_copy(
    stream: IO[bytes],
    size: int,
    contents: Contents,
    path: Path,
    name: str,
    progress: Callable[[int], None] | None = None,
) -> FileSummary:
    """Write a sound file with everything readable of a damaged one, in the same order.

    Args:
        stream: The damaged file.
        size: Its length [bytes].
        contents: Its content by `read_contents`.
        path: The new file.
        name: Its final name.
        progress: Called with the position in the damaged file.

    Raises:
        OSError: No room, or other trouble with the disk; the new file is then removed.
    """
    stream.seek(0)
    file = BagFile(path)
    try:
        file.add_metadata(CUSTOM_DATA_RECORD, contents.custom_data)
        ids: dict[int, int] = {}

        def own(channel: Channel) -> int:
            if channel.id not in ids:
                ids[channel.id] = file.add_channel(
                    channel.topic, channel.message_encoding, contents.schema(channel), channel.metadata
                )
            return ids[channel.id]

        for record in Scan(stream, size, progress, contents.known):
            if isinstance(record, Channel):
                own(record)
            elif isinstance(record, Message) and record.channel_id in contents.channels:
                file.add_message(
                    own(contents.channels[record.channel_id]),
                    record.data,
                    record.log_time,
                    publish_time=record.publish_time,
                    sequence=record.sequence,
                )
            elif isinstance(record, Metadata) and record.name not in (CUSTOM_DATA_RECORD, SUMMARY_RECORD):
                file.add_metadata(record.name, record.metadata)
            elif isinstance(record, Attachment):
                file.add_attachment(record)
        summary = file.summary(name)
        file.finish(bag_information([summary], contents.custom_data, ros_distro=contents.ros_distro))
    except BaseException:
        file.abandon()
        path.unlink(missing_ok=True)
        raise
    return summary


def _index_agrees(path: Path, contents: Contents) -> bool:
    """Return whether readers that trust the index see all messages."""
    try:
        file = McapFile(path, "")
        deque(file.messages(frozenset(file.channels)), maxlen=0)
    except RecordingError:
        return False
    return not file.index_is_damaged and {id: c.count for id, c in file.channels.items()} == {
        id: contents.counts[id] for id in contents.channels
    }

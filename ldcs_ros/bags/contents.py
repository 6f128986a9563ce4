"""The content of an MCAP file, read from its start, and a sound copy of it."""

from __future__ import annotations

import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from ldcs_ros.bags.bag_file import CUSTOM_DATA_RECORD, SUMMARY_RECORD, BagFile
from ldcs_ros.bags.metadata import FileSummary, bag_information, parse_foreign_yaml, topic_summary
from ldcs_ros.bags.scan import Scan
from ldcs_ros.bags.schemas import ROS_DISTRO

_FOOTER = struct.Struct("<BQQQI8s")
"""Opcode, length, start of the summary, start of its offsets, checksum, closing mark."""
_SUMMED_FOOTER = 1 + 8 + 8 + 8
"""Bytes of the footer that its checksum covers."""


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
            self.add_information(_mapping(record.metadata.get("serialized_metadata", "")))

    def add_information(self, information: dict[str, Any]) -> None:
        """Add values of metadata.yaml that the records lack."""
        custom_data = information.get("custom_data")
        if not self.custom_data and isinstance(custom_data, dict):
            self.custom_data = {str(key): str(value) for key, value in custom_data.items()}
        self.ros_distro = self.ros_distro or str(information.get("ros_distro") or "")

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


def read_contents(stream: IO[bytes], size: int, progress: Callable[[int], None] | None = None) -> Contents:
    """Read a file of some length [bytes] once and compare it with its own index."""
    stream.seek(0)
    scan = Scan(stream, size, progress)
    contents = Contents()
    for record in scan:
        contents.add(record)
    contents.dropped += scan.dropped
    contents.sound = scan.finished and not contents.dropped and _index_agrees(stream, contents)
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
        for record in Scan(stream, size, progress):
            if isinstance(record, Channel) and record.id not in ids:
                ids[record.id] = file.add_channel(
                    record.topic, record.message_encoding, contents.schema(record), record.metadata
                )
            elif isinstance(record, Message) and record.channel_id in ids:
                file.add_message(
                    ids[record.channel_id],
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


def _index_agrees(stream: IO[bytes], contents: Contents) -> bool:
    """Return whether the index agrees with the records."""
    try:
        if not _summary_is_right(stream):
            return False
        stream.seek(0)
        index = make_reader(stream).get_summary()
    except (McapError, ValueError, OSError, struct.error):
        return False
    return (
        index is not None
        and index.statistics is not None
        and index.statistics.message_count == contents.counts.total()
        and index.channels.keys() >= contents.channels.keys()
    )


def _summary_is_right(stream: IO[bytes]) -> bool:
    """Return whether the summary has the checksum of the footer; writers may leave it out (0)."""
    end = stream.seek(-_FOOTER.size, os.SEEK_END)
    footer = stream.read()
    _, _, start, _, checksum, _ = _FOOTER.unpack(footer)
    if not 0 < start <= end:
        return False
    stream.seek(start)
    summary = stream.read(end - start)
    return bool(checksum == 0 or zlib.crc32(summary + footer[:_SUMMED_FOOTER]) == checksum)


def _mapping(text: str) -> dict[str, Any]:
    content = parse_foreign_yaml(text)
    return content if isinstance(content, dict) else {}

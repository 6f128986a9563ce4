"""metadata.yaml, version 9: the file in a bag folder that rosbag2 reads before any message."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ldcs_ros.bags.durable import sync_folder
from ldcs_ros.bags.limits import LARGEST_METADATA, check_regular
from ldcs_ros.bags.schemas import ROS_DISTRO
from ldcs_ros.errors import RecordingError, one_line

FILE_NAME = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"


@dataclass(frozen=True)
class TopicSummary:
    """One channel of a written file.

    Attributes:
        topic: Topic name.
        type: Message type.
        encoding: Serialization format, `cdr`.
        qos: Offered profiles, each a mapping of the nine fields.
        type_hash: `RIHS01_...`, empty when unknown.
        count: Messages in the file.
    """

    topic: str
    type: str
    encoding: str
    qos: Sequence[Mapping[str, object]]
    type_hash: str
    count: int


@dataclass(frozen=True)
class BagMetadata:
    """The content of metadata.yaml, each value as the text in the file.

    Attributes:
        content: Its keys below the root key.
        files: Names of the bag's files, in their order; paths of older versions lose their folders.
        compression: Compressed unit: `file`, `message` or '' for none.
        custom_data: Texts by name.
    """

    content: Mapping[str, object]

    @property
    def files(self) -> tuple[str, ...]:
        """The names of the files in their order, without folders."""
        listed = self.content.get("relative_file_paths")
        return (
            tuple(Path(name).name for name in listed if isinstance(name, str))
            if isinstance(listed, list)
            else ()
        )

    @property
    def compression(self) -> str:
        """'file', 'message' or '' without any."""
        mode = self.content.get("compression_mode")
        return mode.lower() if isinstance(mode, str) and mode.lower() != "none" else ""

    @property
    def custom_data(self) -> dict[str, str]:
        """The recorder's own texts by key."""
        texts = self.content.get("custom_data")
        return {str(k): v for k, v in texts.items() if isinstance(v, str)} if isinstance(texts, dict) else {}


def parse_metadata(text: str, origin: str) -> BagMetadata:
    """Return the metadata of a text; values stay texts, so that no reader of YAML can mistake one.

    Raises:
        RecordingError: It is no YAML, or has not the root key.
    """
    try:
        content = yaml.load(text, Loader=yaml.BaseLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise RecordingError(f"{origin} is no valid YAML: {one_line(error)[:200]}") from error
    information = content.get(ROOT_KEY) if isinstance(content, dict) else None
    if not isinstance(information, dict):
        raise RecordingError(f"{origin} has no block {ROOT_KEY!r}")
    return BagMetadata(information)


def read_metadata(folder: Path) -> BagMetadata:
    """Return the metadata of a bag folder.

    Raises:
        RecordingError: It cannot be read, is larger than bounds allow, or is no metadata.
    """
    path = folder / FILE_NAME
    size = check_regular(path)
    if size > LARGEST_METADATA:
        raise RecordingError(f"{path} has {size} bytes, expected at most {LARGEST_METADATA}")
    try:
        return parse_metadata(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path} cannot be read: {one_line(error)}") from error


def parse_foreign_yaml(text: str) -> object:
    """Return the content of YAML that any recorder may have written; None if it is invalid.

    The strict reader is for files that people write. Other recorders repeat keys and write numbers in ways that it
    refuses, and their bags are read as far as possible.
    """
    try:
        content: object = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):  # ValueError: a date that does not exist
        return None
    return content


def topic_summary(
    topic: str, message_type: str, encoding: str, channel_metadata: Mapping[str, str], count: int
) -> TopicSummary:
    """Return a channel as its MCAP record describes it; profiles that are no YAML list are left out."""
    profiles = parse_foreign_yaml(channel_metadata.get("offered_qos_profiles") or "[]")
    qos = [profile for profile in profiles if isinstance(profile, dict)] if isinstance(profiles, list) else []
    type_hash = channel_metadata.get("topic_type_hash", "")
    return TopicSummary(topic, message_type, encoding, qos, type_hash, count)


@dataclass(frozen=True)
class FileSummary:
    """One written file: name in the folder, first and last log time [ns] (0 when empty), its channels."""

    name: str
    start: int
    end: int
    topics: tuple[TopicSummary, ...]

    @property
    def count(self) -> int:
        """Messages in the file."""
        return sum(topic.count for topic in self.topics)


def bag_information(
    files: Sequence[FileSummary],
    custom_data: Mapping[str, str],
    *,
    ros_distro: str = ROS_DISTRO,
    packed_messages: bool = False,
) -> dict[str, Any]:
    """Return the content of metadata.yaml without its root key; it always has all fields."""
    filled = [file for file in files if file.count]
    start = min((file.start for file in filled), default=0)
    end = max((file.end for file in filled), default=0)
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.count for file in files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.topic,
                    "type": topic.type,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": [dict(profile) for profile in topic.qos],
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in _merged(files)
        ],
        "compression_format": "zstd" if packed_messages else "",
        "compression_mode": "MESSAGE" if packed_messages else "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                "starting_time": {"nanoseconds_since_epoch": file.start},
                "duration": {"nanoseconds": file.end - file.start},
                "message_count": file.count,
            }
            for file in files
        ],
        "custom_data": dict(custom_data),
        "ros_distro": ros_distro,
    }


def _merged(files: Sequence[FileSummary]) -> list[TopicSummary]:
    """Return the channels over all files: one entry for each topic and type."""
    merged: dict[tuple[str, str], TopicSummary] = {}
    for topic in (topic for file in files for topic in file.topics):
        key = topic.topic, topic.type
        before = merged[key].count if key in merged else 0
        merged[key] = TopicSummary(
            topic.topic, topic.type, topic.encoding, topic.qos, topic.type_hash, before + topic.count
        )
    return list(merged.values())


def dump(content: object) -> str:
    """Return YAML text: keys in the order given, texts of several lines as readable blocks."""
    return str(yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True))


def write_metadata(folder: Path, information: Mapping[str, object]) -> None:
    """Write metadata.yaml whole or not at all: beside it, then renamed over it."""
    part = folder / f".{FILE_NAME}.part"
    try:
        with open(part, "w", encoding="utf-8") as stream:
            stream.write(dump({ROOT_KEY: dict(information)}))
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, folder / FILE_NAME)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    sync_folder(folder)


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """Safe YAML without anchors, which other readers need not know."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="|" if "\n" in text else None)


_Dumper.add_representer(str, _represent_text)

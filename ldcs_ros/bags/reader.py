"""read_bag: a ROS 2 bag, MCAP or sqlite3, ours or any rig's, opened as a Recording."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import cast

from mcap.exceptions import McapError
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import Reader, ReaderError

from ldcs_ros.bags.bag_file import CUSTOM_DATA_RECORD
from ldcs_ros.bags.metadata import FILE_NAME, ROOT_KEY, parse_foreign_yaml
from ldcs_ros.bags.recording import Decoder, Message, Recording
from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.bags.topics import Qos, TopicInfo
from ldcs_ros.errors import RecordingError, one_line

MAGIC = b"\x89MCAP0\r\n"
STORAGE_SUFFIXES = (".mcap", ".db3")


def read_bag(path: str | os.PathLike[str]) -> Recording:
    """Open a bag; its messages are read on demand.

    Args:
        path: Bag folder (with metadata.yaml), .mcap file or .db3 file.

    Raises:
        RecordingError: Nothing there, not a bag, cut off before its end, or damaged; here or while reading.
    """
    bag = Path(path)
    _check_whole(bag)
    with _opened(bag) as reader:
        topics: dict[str, TopicInfo] = {}
        counts: dict[str, int] = {}
        for connection in reader.connections:
            known = topics.setdefault(connection.topic, TopicInfo(connection.msgtype, _qos(connection)))
            if known.type != connection.msgtype:
                raise RecordingError(
                    f"{bag}: topic {connection.topic} carries two types, {known.type} and "
                    f"{connection.msgtype}; a recording has one type on a topic"
                )
            counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
        empty = reader.message_count == 0
        start, end = (0, 0) if empty else (reader.start_time, reader.end_time - 1)
    return Recording(str(bag), topics, counts, _custom_data(bag), start, end, _Bag(bag))


class _Bag:
    """Messages read again from the files at each pass."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @cached_property
    def decoder(self) -> Decoder:
        """Types as the bag defines them; ROS 2 Kilted defines the others."""
        known = Schemas().typestore
        try:
            with AnyReader([self._path], default_typestore=known) as reader:
                types = reader.typestore
        except (AnyReaderError, ReaderError, OSError) as error:
            raise RecordingError(f"{self._path}: unreadable message types: {one_line(error)}") from error
        missing = known.fielddefs.keys() - types.fielddefs.keys()
        types.register({name: known.fielddefs[name] for name in missing})
        return types

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        with _opened(self._path) as reader:
            wanted = [c for c in reader.connections if topics is None or c.topic in topics]
            if wanted:  # rosbags takes an empty list for all
                for connection, time, data in reader.messages(wanted):
                    yield Message(connection.topic, connection.msgtype, bytes(data), time)


@contextmanager
def _opened(bag: Path) -> Iterator[Reader]:
    """Return a rosbags reader whose many kinds of errors leave as one."""
    try:
        with Reader(bag) as reader:
            yield reader
    except RecordingError:
        raise
    except Exception as error:  # damage may break decompression, parsing or SQL, each with errors of its own
        raise RecordingError(
            f"{bag} is damaged or no ROS 2 bag: {one_line(error)}; `ldcs recover {bag}` may repair an MCAP bag"
        ) from error


def _check_whole(bag: Path) -> None:
    """Raise the error for a path that is no complete bag, before any reader opens it."""
    if not bag.exists():
        raise RecordingError(f"no bag at {bag}; give a bag folder, a .mcap file or a .db3 file")
    if bag.is_file():
        if bag.suffix not in STORAGE_SUFFIXES:
            raise RecordingError(f"{bag} is no bag; expected a bag folder, a .mcap file or a .db3 file")
        files = [bag]
    else:
        files = sorted(file for file in bag.iterdir() if file.suffix in STORAGE_SUFFIXES)
        if not (bag / FILE_NAME).exists():
            if not files:
                raise RecordingError(f"{bag} is no bag: it has no {FILE_NAME} and no .mcap or .db3 file")
            repair = "ldcs recover" if files[0].suffix == ".mcap" else "ros2 bag reindex"
            raise RecordingError(f"{bag} was not closed: it has no {FILE_NAME}; run `{repair} {bag}`")
    for file in files:
        if file.suffix == ".mcap":
            _check_marks(file, bag)


def _check_marks(file: Path, bag: Path) -> None:
    """Check the mark at the beginning and at the end of an MCAP file."""
    try:
        with open(file, "rb") as stream:
            opening = stream.read(len(MAGIC))
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(len(opening), size - len(MAGIC)))
            closing = stream.read()
    except OSError as error:
        raise RecordingError(f"{file} cannot be read: {one_line(error)}") from error
    if not MAGIC.startswith(opening):
        raise RecordingError(f"{file} is no MCAP file: it does not begin like one")
    if closing != MAGIC:
        raise RecordingError(f"{file} was cut off before its end; run `ldcs recover {bag}`")


def _custom_data(bag: Path) -> dict[str, str]:
    """Return custom_data of a bag: from metadata.yaml, or from the record of a single MCAP file."""
    try:
        if bag.is_dir():
            content = parse_foreign_yaml((bag / FILE_NAME).read_text(encoding="utf-8"))
            if not isinstance(content, dict):
                raise RecordingError(f"{bag}: {FILE_NAME} is not valid YAML; run `ldcs recover {bag}`")
            custom_data = content[ROOT_KEY].get("custom_data") or {}
            return {str(key): str(value) for key, value in custom_data.items()}
        if bag.suffix == ".mcap":
            with open(bag, "rb") as stream:
                for record in make_reader(stream).iter_metadata():
                    if record.name == CUSTOM_DATA_RECORD:
                        return dict(record.metadata)
    except (OSError, UnicodeDecodeError, McapError, KeyError, TypeError, AttributeError) as error:
        raise RecordingError(f"{bag}: its custom_data cannot be read: {one_line(error)}") from error
    return {}


def _qos(connection: Connection) -> Qos:
    offered = cast(ConnectionExtRosbag2, connection.ext).offered_qos_profiles
    if not offered:
        return Qos()
    first = offered[0]
    return Qos(
        reliability=first.reliability.name.lower(),
        durability=first.durability.name.lower(),
        history=first.history.name.lower(),
        depth=first.depth,
    )

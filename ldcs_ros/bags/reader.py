"""read_bag: a ROS 2 bag, MCAP or sqlite3, ours or any rig's, opened as a Recording."""

from __future__ import annotations

import heapq
import os
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import zstandard

from ldcs_ros.bags import mcap_records, sqlite3_file
from ldcs_ros.bags.limits import LARGEST_CHUNK, check_regular, unpack
from ldcs_ros.bags.mcap_file import McapFile
from ldcs_ros.bags.metadata import FILE_NAME, BagMetadata, read_metadata
from ldcs_ros.bags.recording import Decoder, Message, Recording
from ldcs_ros.bags.sqlite3_file import Sqlite3File
from ldcs_ros.bags.storage import Definition, StorageFile, StoredChannel
from ldcs_ros.bags.topics import TopicInfo
from ldcs_ros.bags.types import BagTypes
from ldcs_ros.errors import RecordingError, one_line, path_in_words, user_path

STORAGE_SUFFIXES = (".mcap", ".db3")
PACKED_SUFFIX = ".zstd"
SMALLEST_BOUND = 2**28
LARGEST_RATIO = 50
"""A packed file may unpack to SMALLEST_BOUND, or to LARGEST_RATIO times its size."""


def read_bag(path: str | os.PathLike[str]) -> Recording:
    """Open a bag; its messages are read on demand.

    A channel that holds no ROS 2 messages, and a file that metadata.yaml does not list, are left out with a note.

    Args:
        path: Bag folder (with metadata.yaml), .mcap file or .db3 file.

    Raises:
        RecordingError: Nothing there, not a bag, cut off before its end, or damaged; here or while reading.
    """
    bag = user_path(path)
    with _one_line(bag):
        metadata, files, notes = _contents(bag)
        source = _Bag(bag, files, metadata.compression == "message")
        topics: dict[str, TopicInfo] = {}
        counts: dict[str, int] = {}
        for channel in source.channels:
            known = topics.setdefault(channel.topic, channel.info)
            if known.type != channel.info.type:
                raise RecordingError(
                    f"{bag}: topic {channel.topic} carries two types, {known.type} and "
                    f"{channel.info.type}; a recording has one type on a topic"
                )
            counts[channel.topic] = counts.get(channel.topic, 0) + channel.count
        foreign = source.foreign
        if foreign and not topics:
            raise RecordingError(f"{bag} holds no ROS 2 messages, only {', '.join(foreign)}")
        if foreign:
            notes.append(f"left out, since they hold no ROS 2 messages: {', '.join(foreign)}")
        filled = [file for file in source.files if file.end or any(c.count for c in file.channels.values())]
        start, end = min((f.start for f in filled), default=0), max((f.end for f in filled), default=0)
        total = sum(channel.count for file in source.files for channel in file.channels.values())
        said = metadata.content.get("message_count")
        if said is not None and said != str(total):
            notes.append(f"{FILE_NAME} counts {str(said)[:20]} messages, the files hold {total}")
    custom_data = metadata.custom_data
    for file in source.files:
        custom_data = custom_data or dict(file.custom_data)
    return Recording(path_in_words(bag), topics, counts, custom_data, start, end, source, tuple(notes))


@dataclass(frozen=True)
class _Bag:
    """The files of a bag; messages are read again from them at each pass."""

    path: Path
    files: tuple[StorageFile, ...]
    packed_messages: bool

    @property
    def channels(self) -> list[StoredChannel]:
        """The channels with ROS 2 messages, of all files."""
        return [channel for file in self.files for channel in file.channels.values() if channel.is_ros]

    @property
    def foreign(self) -> list[str]:
        """The other channels, in words."""
        return sorted(
            {
                f"{channel.topic[:100]} ({channel.encoding[:20] or 'no encoding'}"
                f"{'' if channel.encoding != 'cdr' else ' without a ROS 2 type'})"
                for file in self.files
                for channel in file.channels.values()
                if not channel.is_ros
            }
        )

    @cached_property
    def decoder(self) -> Decoder:
        definitions: dict[str, list[Definition]] = {}
        for channel in self.channels:
            known = definitions.setdefault(channel.info.type, [])
            if channel.definition not in known:
                known.append(channel.definition)
        return BagTypes(str(self.path), definitions)

    def spans(self) -> Iterator[tuple[int, int]]:
        with _one_line(self.path):
            for file in self.files:
                yield from file.spans()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        with _one_line(self.path):
            yield from heapq.merge(
                *(self._of_file(file, topics) for file in self.files), key=lambda message: message.time
            )

    def _of_file(self, file: StorageFile, topics: Collection[str] | None) -> Iterator[Message]:
        wanted = {
            id: channel
            for id, channel in file.channels.items()
            if channel.is_ros and (topics is None or channel.topic in topics)
        }
        for time, id, data in file.messages(frozenset(wanted)) if wanted else ():
            info = wanted[id].info
            cdr = _unpacked(data) if self.packed_messages else data
            yield Message(wanted[id].topic, info.type, cdr, time)


@contextmanager
def _one_line(bag: Path) -> Iterator[None]:
    """Convert errors of all parsers of bags to one RecordingError."""
    try:
        yield
    except RecordingError:
        raise
    except MemoryError as error:
        raise RecordingError(f"{bag} needs more memory than there is") from error
    except Exception as error:  # damage may break decompression, parsing or SQL, each with errors of its own
        raise RecordingError(f"{bag} is damaged or no ROS 2 bag: {one_line(error)[:200]}") from error


def _contents(bag: Path) -> tuple[BagMetadata, tuple[StorageFile, ...], list[str]]:
    """Return what metadata.yaml says, the files that it lists, and notes."""
    if not bag.exists():
        raise RecordingError(f"no bag at {bag}; give a bag folder, a .mcap file or a .db3 file")
    if not bag.is_dir():
        if bag.suffix not in STORAGE_SUFFIXES:
            raise RecordingError(f"{bag} is no bag; expected a bag folder, a .mcap file or a .db3 file")
        return BagMetadata({}), (_open(bag, bag),), []
    here = sorted(file.name for file in bag.iterdir() if _is_storage(file))
    if not (bag / FILE_NAME).exists():
        if not here:
            raise RecordingError(f"{bag} is no bag: it has no {FILE_NAME} and no .mcap or .db3 file")
        repair = "ldcs recover" if here[0].endswith(".mcap") else "ros2 bag reindex"
        raise RecordingError(f"{bag} was not closed: it has no {FILE_NAME}; run `{repair} {bag}`")
    try:
        metadata = read_metadata(bag)
    except RecordingError as error:
        hint = f"; `ldcs recover {bag}` writes it again" if any(n.endswith(".mcap") for n in here) else ""
        raise RecordingError(f"{bag} is damaged or no ROS 2 bag: {error}{hint}") from error
    if not metadata.files:
        raise RecordingError(f"{bag / FILE_NAME} lists no files")
    if metadata.compression not in ("", "file", "message"):
        raise RecordingError(
            f"{bag} has the compression mode {metadata.compression[:20]!r}, expected file or message"
        )
    missing = sorted(set(metadata.files) - {file.name for file in bag.iterdir()})
    if missing:
        raise RecordingError(f"{bag} lacks {missing[0]}, which its {FILE_NAME} lists")
    beside = sorted(set(here) - set(metadata.files))
    notes = [f"left out, since {FILE_NAME} does not list them: {', '.join(beside)}"] if beside else []
    return metadata, tuple(_open(bag / name, bag) for name in dict.fromkeys(metadata.files)), notes


def _is_storage(file: Path) -> bool:
    return file.name.removesuffix(PACKED_SUFFIX).endswith(STORAGE_SUFFIXES) and not file.name.startswith(".")


def _open(file: Path, bag: Path) -> StorageFile:
    """Open a file by what it is, not by its name."""
    check_regular(file)
    with open(file, "rb") as stream:
        opening = stream.read(max(len(sqlite3_file.MAGIC), len(mcap_records.MAGIC)))
    if file.name.endswith(PACKED_SUFFIX):
        return _PackedFile(file)
    if opening == sqlite3_file.MAGIC:
        return Sqlite3File(file)
    if file.suffix == ".db3":
        raise RecordingError(f"{file} is damaged or no ROS 2 bag: it does not begin like a sqlite3 file")
    return McapFile(file, f"run `ldcs recover {bag}`")


class _PackedFile:
    """A file of a bag with the compression mode `file`, unpacked into a temporary folder while it is used."""

    def __init__(self, file: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="ldcs_bag_")
        unpacked = Path(self._folder.name) / file.name.removesuffix(PACKED_SUFFIX)
        _unpack_file(file, unpacked)
        self._file = _open(unpacked, file)
        self.channels, self.custom_data = self._file.channels, self._file.custom_data
        self.start, self.end = self._file.start, self._file.end

    def spans(self) -> Iterator[tuple[int, int]]:
        yield from self._file.spans()

    def messages(self, wanted: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
        yield from self._file.messages(wanted)


def _unpack_file(file: Path, unpacked: Path) -> None:
    bound = max(SMALLEST_BOUND, LARGEST_RATIO * check_regular(file))
    try:
        with open(file, "rb") as packed, open(unpacked, "xb") as stream:
            size = 0
            for part in zstandard.ZstdDecompressor().read_to_iter(packed):
                size += len(part)
                if size > bound:
                    raise RecordingError(
                        f"{file} unpacks to more than {bound} bytes; unpack it with `zstd -d`"
                    )
                stream.write(part)
    except (zstandard.ZstdError, MemoryError) as error:
        raise RecordingError(f"{file} cannot be unpacked: {one_line(error)}") from error


def _unpacked(data: bytes) -> bytes:
    message = unpack("zstd", data, LARGEST_CHUNK)
    if len(message) > LARGEST_CHUNK:
        raise RecordingError(f"a message unpacks to more than {LARGEST_CHUNK} bytes")
    return message

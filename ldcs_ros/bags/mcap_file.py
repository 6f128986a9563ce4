"""One MCAP file for reading, written with any option: with or without chunks, index, statistics, repeated records.

The walk over the heads of the records finds every chunk and every message outside of chunks. Channels, schemas and
counts come from the summary where it is complete, and from all chunks where it is not.
"""

from __future__ import annotations

import heapq
import os
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple, NoReturn

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Metadata, Schema, Statistics

from ldcs_ros.bags.limits import LARGEST_CHUNK, LARGEST_METADATA
from ldcs_ros.bags.mcap_records import (
    CHECKSUM,
    CHUNK_HEAD,
    COMPRESSIONS,
    HEAD,
    LENGTH,
    MAGIC,
    MESSAGE_HEAD,
    UNREADABLE,
    Record,
    chunk_records,
    is_opcode,
    open_chunk,
    summary_records,
)
from ldcs_ros.bags.storage import LATEST, Definition, StoredChannel
from ldcs_ros.bags.topics import TopicInfo, parse_qos
from ldcs_ros.errors import RecordingError, one_line

CUSTOM_DATA_RECORD = "ldcs_ros"
"""Metadata record, first in the file, that holds custom_data: it is there even when the end is not."""
MOST_OPEN = 512 * 2**20
"""Bytes of messages that chunks which overlap in time may hold in memory at once."""


class _Block(NamedTuple):
    """A chunk, or a message outside of chunks.

    Attributes:
        position: Place of its record in the file [bytes].
        length: Length of the record's body [bytes].
        start: Its earliest log time [ns].
        end: Its latest log time [ns].
        is_chunk: It is a chunk.
    """

    position: int
    length: int
    start: int
    end: int
    is_chunk: bool


@dataclass
class _Found:
    """Channels, schemas and counts, from the summary or from the data.

    Attributes:
        schemas: Schema id -> schema.
        channels: Channel id -> channel.
        counts: Channel id -> messages.
        start: Earliest log time [ns].
        end: Latest log time [ns].
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    start: int = 2**64 - 1
    end: int = 0

    def add(self, opcode: int, body: bytes | memoryview) -> None:
        if opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            self.counts[channel] += 1
            self.start, self.end = min(self.start, time), max(self.end, time)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            one = Channel.read(ReadDataStream(BytesIO(body)))
            known = self.channels.setdefault(one.id, one)
            if (known.topic, known.schema_id) != (one.topic, one.schema_id):
                raise ValueError(f"channel {one.id} is both {known.topic} and {one.topic}")

    @property
    def complete(self) -> bool:
        """Every counted message has its channel, every channel its schema."""
        return self.counts.keys() <= self.channels.keys() and all(
            channel.schema_id == 0 or channel.schema_id in self.schemas for channel in self.channels.values()
        )


class McapFile:
    """An MCAP file, open for reading.

    Args:
        path: The file; it is opened again at each pass.
        advice: Remedy of damage, for errors.

    Attributes:
        channels: Channel id -> channel.
        start: Earliest log time [ns]; 0 without messages.
        end: Latest log time [ns]; 0 without messages.
        custom_data: Texts that this package stored in the file itself.
        index_is_damaged: There is a summary that cannot be read; all chunks were read instead.

    Raises:
        RecordingError: The file is cut off, damaged, or holds what is out of bounds.
    """

    def __init__(self, path: Path, advice: str) -> None:
        self._path = path
        self._advice = advice
        self._blocks: list[_Block] = []
        self._skippable: dict[int, frozenset[int]] = {}
        self._claimed: int | None = None
        self.index_is_damaged = False
        self.custom_data: dict[str, str] = {}
        with open(path, "rb") as stream:
            self._size = stream.seek(0, os.SEEK_END)
            self._check_marks(stream)
            found, data_end = self._walk(stream)
            indexed = self._summary(stream, data_end, found)
            if indexed is None:
                indexed = self._read_all(stream, found)
        self._check(indexed)
        self.start, self.end = (indexed.start, indexed.end) if indexed.counts.total() else (0, 0)
        self.channels: Mapping[int, StoredChannel] = {
            id: _stored(one, indexed.schemas.get(one.schema_id), indexed.counts[id])
            for id, one in indexed.channels.items()
        }

    def spans(self) -> Iterator[tuple[int, int]]:
        """Yield the span of each chunk and the time of each message outside of chunks [ns]; no chunk is opened."""
        return ((block.start, block.end) for block in self._blocks if block.start or block.end)

    def messages(self, wanted: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield (log time [ns], channel id, bytes) of some channels by log time, equal times in the order of writing.

        Raises:
            RecordingError: The file is damaged, or holds less than it claims.
        """
        expected = sum(one.count for id, one in self.channels.items() if id in wanted)
        blocks = sorted(block for block in self._blocks if not self._skips(block, wanted))
        blocks.sort(key=lambda block: block.start)
        count = 0
        pending: list[tuple[int, int, int, int, bytes]] = []
        held = 0
        with open(self._path, "rb") as stream:
            for block in blocks:
                while pending and pending[0][0] < block.start:
                    time, _, _, channel, data = heapq.heappop(pending)
                    held -= len(data)
                    count += 1
                    yield time, channel, data
                for number, (time, channel, data) in enumerate(self._block(stream, block, wanted)):
                    heapq.heappush(pending, (time, block.position, number, channel, data))
                    held += len(data)
                if held > MOST_OPEN:
                    raise RecordingError(
                        f"{self._path}: chunks that overlap in time hold more than {MOST_OPEN >> 20} MB; "
                        "sort the file by time first (`mcap sort`)"
                    )
        while pending:
            time, _, _, channel, data = heapq.heappop(pending)
            count += 1
            yield time, channel, data
        if count != expected:
            self._refuse(f"its index counts {expected} messages where {count} were found")

    def _refuse(self, problem: str) -> NoReturn:
        raise RecordingError(f"{self._path} is damaged: {problem}; {self._advice}")

    def _check_marks(self, stream: IO[bytes]) -> None:
        stream.seek(0)
        opening = stream.read(len(MAGIC))
        stream.seek(max(len(opening), self._size - len(MAGIC)))
        closing = stream.read()
        if not opening:
            raise RecordingError(f"{self._path} is empty")
        if not MAGIC.startswith(opening):
            raise RecordingError(f"{self._path} is no MCAP file: it does not begin like one")
        if closing != MAGIC:
            raise RecordingError(f"{self._path} was cut off before its end; {self._advice}")

    def _walk(self, stream: IO[bytes]) -> tuple[_Found, int]:
        """Return the records outside of chunks, and the place of the end of the data."""
        found = _Found()
        position = len(MAGIC)
        while True:
            stream.seek(position)
            head = stream.read(HEAD.size)
            if len(head) < HEAD.size:
                self._refuse("its data has no end")
            opcode, length = HEAD.unpack(head)
            if opcode == Opcode.DATA_END:
                self._check_data(stream, position, stream.read(CHECKSUM.size))
                return found, position + HEAD.size + length
            if not is_opcode(opcode) or opcode == Opcode.FOOTER:
                self._refuse(f"there is no record at byte {position}")
            if length > self._size - position - HEAD.size:
                self._refuse(f"the record at byte {position} claims {length} bytes, more than there are")
            try:
                self._note(stream, opcode, position, length, found)
            except UNREADABLE as error:
                self._refuse(f"the record at byte {position} is unreadable: {one_line(error)}")
            position += HEAD.size + length

    def _check_data(self, stream: IO[bytes], end: int, stored: bytes) -> None:
        """Compare the data up to their end with their checksum, if there is one and no chunk has its own."""
        if all(block.is_chunk for block in self._blocks) or stored in (b"", bytes(CHECKSUM.size)):
            return
        stream.seek(0)
        checksum, left = 0, end
        while left:
            piece = stream.read(min(left, LARGEST_METADATA))
            checksum, left = zlib.crc32(piece, checksum), left - len(piece)
        if stored != CHECKSUM.pack(checksum):
            raise RecordingError(
                f"{self._path} is damaged: the checksum of its data is wrong; "
                "`ldcs recover` keeps every message, the damaged one too"
            )

    def _note(self, stream: IO[bytes], opcode: int, position: int, length: int, found: _Found) -> None:
        if opcode == Opcode.CHUNK:
            start, end, size, _, name = CHUNK_HEAD.unpack(stream.read(CHUNK_HEAD.size))
            self._check_size(max(length, size), f"the chunk at byte {position}", LARGEST_CHUNK)
            self._check_compression(stream.read(min(name, length)), position)
            packed = LENGTH.unpack(stream.read(LENGTH.size))[0]
            if CHUNK_HEAD.size + name + LENGTH.size + packed != length:
                raise ValueError(f"the chunk claims {packed} bytes of {length}")
            self._blocks.append(_Block(position, length, start, end, True))
        elif opcode == Opcode.MESSAGE:
            self._check_size(length, f"the message at byte {position}", LARGEST_CHUNK)
            body = stream.read(MESSAGE_HEAD.size)
            found.add(opcode, body)
            time = MESSAGE_HEAD.unpack(body)[2]
            self._blocks.append(_Block(position, length, time, time, False))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._check_size(length, f"the record at byte {position}", LARGEST_METADATA)
            found.add(opcode, stream.read(length))
        elif opcode == Opcode.METADATA and not self.custom_data and length <= LARGEST_METADATA:
            with suppress(*UNREADABLE):  # metadata.yaml holds the same
                record = Metadata.read(ReadDataStream(BytesIO(stream.read(length))))
                if record.name == CUSTOM_DATA_RECORD:
                    self.custom_data = dict(record.metadata)

    def _check_compression(self, name: bytes, position: int) -> None:
        if name not in COMPRESSIONS:
            raise RecordingError(
                f"{self._path}: the chunk at byte {position} is compressed with {name[:20]!r}, expected zstd, lz4 "
                "or none; `ldcs recover` leaves such chunks out"
            )

    def _check_size(self, size: int, record: str, limit: int) -> None:
        if size > limit:
            raise RecordingError(
                f"{self._path}: {record} claims {size} bytes, expected at most {limit}; "
                "write the bag again with smaller chunks (`ros2 bag convert`)"
            )

    def _summary(self, stream: IO[bytes], data_end: int, data: _Found) -> _Found | None:
        """Return what the summary says; None, with its channels in `data`, unless it is complete."""
        chunks = [block for block in self._blocks if block.is_chunk]
        found, statistics = _Found(), None
        named: dict[int, tuple[int, int]] = {}
        try:
            for opcode, body in summary_records(stream, self._size, data_end):
                if opcode == Opcode.STATISTICS:
                    statistics = Statistics.read(ReadDataStream(BytesIO(body)))
                elif opcode == Opcode.CHUNK_INDEX:
                    index = ChunkIndex.read(ReadDataStream(BytesIO(body)))
                    named[index.chunk_start_offset] = index.message_start_time, index.message_end_time
                    if index.message_index_offsets:
                        self._skippable[index.chunk_start_offset] = frozenset(index.message_index_offsets)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    found.add(opcode, body)
        except UNREADABLE:
            self.index_is_damaged = True
            return None
        data.schemas = {**found.schemas, **data.schemas}
        data.channels = {**found.channels, **data.channels}
        hidden = named.keys() - {chunk.position for chunk in chunks}
        if hidden:
            self._refuse(f"a record before byte {min(hidden)} has a wrong length and hides a chunk")
        if statistics is None:
            return None
        if any(named.get(chunk.position, chunk[2:4]) != chunk[2:4] for chunk in chunks):
            self.index_is_damaged = True
            return None
        if statistics.chunk_count != len(chunks):
            self._refuse(f"its index counts {statistics.chunk_count} chunks where {len(chunks)} were found")
        self._claimed = statistics.message_count
        if len(chunks) < len(self._blocks):
            return None
        found.counts.update(statistics.channel_message_counts)
        found.start, found.end = statistics.message_start_time, statistics.message_end_time
        filled = [chunk for chunk in chunks if chunk.start or chunk.end]
        spanned = self._claimed == 0 or (
            bool(filled)
            and found.start == min(chunk.start for chunk in filled)
            and found.end == max(chunk.end for chunk in filled)
        )
        return found if spanned and found.complete and found.counts.total() == self._claimed else None

    def _read_all(self, stream: IO[bytes], found: _Found) -> _Found:
        """Return what the data says; each chunk is opened once, and its true span is noted."""
        self._skippable.clear()
        for number, block in enumerate(self._blocks):
            if block.is_chunk:
                inside = _Found(found.schemas, found.channels)
                for record in self._records(stream, block):
                    try:
                        inside.add(*record)
                    except UNREADABLE as error:
                        self._refuse(f"the chunk at byte {block.position}: {one_line(error)}")
                found.counts.update(inside.counts)
                found.start, found.end = min(found.start, inside.start), max(found.end, inside.end)
                self._blocks[number] = block._replace(start=min(inside.start, inside.end), end=inside.end)
        return found

    def _check(self, found: _Found) -> None:
        if self._claimed not in (None, found.counts.total()):
            self._refuse(f"its index counts {self._claimed} messages where {found.counts.total()} were found")
        lost = found.counts.keys() - found.channels.keys()
        if lost:
            self._refuse(f"{sum(found.counts[id] for id in lost)} messages have no channel")
        if found.counts.total() and found.end > LATEST:
            raise RecordingError(
                f"{self._path} has a log time of {found.end} ns, after the year 2262; "
                "the recorder's clock was wrong, and nothing was read"
            )

    def _skips(self, block: _Block, wanted: frozenset[int]) -> bool:
        channels = self._skippable.get(block.position)
        return channels is not None and not channels & wanted

    def _block(
        self, stream: IO[bytes], block: _Block, wanted: frozenset[int]
    ) -> Iterator[tuple[int, int, bytes]]:
        if not block.is_chunk:
            stream.seek(block.position + HEAD.size)
            records: Iterator[Record] = iter([Record(Opcode.MESSAGE, memoryview(stream.read(block.length)))])
        else:
            records = self._records(stream, block)
        for opcode, body in records:
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
                if channel not in self.channels or not block.start <= time <= block.end:
                    self._refuse(f"the chunk at byte {block.position} holds records that its index lacks")
                if channel in wanted:
                    yield time, channel, bytes(body[MESSAGE_HEAD.size :])

    def _records(self, stream: IO[bytes], chunk: _Block) -> Iterator[Record]:
        stream.seek(chunk.position + HEAD.size)
        try:
            yield from chunk_records(open_chunk(stream.read(chunk.length)))
        except UNREADABLE as error:
            self._refuse(f"the chunk at byte {chunk.position} is unreadable: {one_line(error)}")


def _stored(channel: Channel, schema: Schema | None, count: int) -> StoredChannel:
    definition, name = Definition(), ""
    if schema is not None and schema.encoding in ("", "ros2msg", "ros2idl"):
        name = _full_name(schema.name)
        definition = Definition(schema.encoding, schema.data.decode(errors="replace"))
    qos = parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    return StoredChannel(channel.topic, TopicInfo(name, qos), channel.message_encoding, definition, count)


def _full_name(name: str) -> str:
    package, *rest = name.split("/")
    return f"{package}/msg/{rest[0]}" if len(rest) == 1 else name

"""A reader of damaged MCAP files, record by record from the start as far as possible."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Header, McapRecord, Message, Metadata, Schema

from ldcs_ros.bags.limits import LARGEST_CHUNK, unpack
from ldcs_ros.bags.mcap_records import (
    CHUNK_HEAD,
    HEAD,
    LENGTH,
    MAGIC,
    MESSAGE_HEAD,
    UNREADABLE,
    chunk_records,
    is_opcode,
    open_chunk,
    summary_records,
)

_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}
_KEPT = {Opcode.MESSAGE, Opcode.CHUNK, *_READERS}


@dataclass
class Scan:
    """An iterator over the records with content; its counters then describe the damage.

    Args:
        stream: The file, at its start.
        size: Its length [bytes].
        progress: Called with the position before each record outside chunks.
        known: Places of chunks that the index names, ascending: where reading goes on after damage.

    Attributes:
        position: Bytes read so far.
        dropped: Bytes of whole or cut records that could not be used [bytes].
        finished: The file had its footer and closing mark.
    """

    stream: IO[bytes]
    size: int
    progress: Callable[[int], None] | None = None
    known: Sequence[int] = ()
    position: int = 0
    dropped: int = 0
    finished: bool = False

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield header, schemas, channels, messages, attachments and metadata in file order; chunks are opened.

        The iteration ends at the summary, at a cut, or at the first invalid record that no known chunk follows.
        """
        if self._read(len(MAGIC)) != MAGIC:
            self.dropped = self.size
            return
        while self.position < self.size:
            if self.progress is not None:
                self.progress(self.position)
            start = self.position
            head = self._read(HEAD.size)
            if len(head) < HEAD.size:
                self.dropped += len(head)
                return
            opcode, length = HEAD.unpack(head)
            if opcode == Opcode.DATA_END:
                self._finish()
                return
            further = self._next_known(start)
            if further is not None and (not is_opcode(opcode) or self.position + length > further):
                self._go_on(start, further)
                continue
            if not is_opcode(opcode):
                self.dropped += self.size - start
                return
            if (
                opcode not in _KEPT and self.position + length <= self.size
            ):  # a cut index is no loss: it is made again
                self._seek(self.position + length)
                continue
            body = self._read(min(length, self.size - self.position))
            whole = len(body) == length
            if opcode == Opcode.CHUNK:
                yield from self._chunk(body, whole)
            elif whole:
                yield from self._record(opcode, body)
            elif opcode in _KEPT:
                self.dropped += len(head) + len(body)

    def _read(self, length: int) -> bytes:
        data = self.stream.read(length)
        self.position += len(data)
        return data

    def _seek(self, position: int) -> None:
        self.stream.seek(position)
        self.position = position

    def _next_known(self, position: int) -> int | None:
        index = bisect_right(self.known, position)
        return self.known[index] if index < len(self.known) else None

    def _go_on(self, start: int, further: int) -> None:
        self.dropped += further - start
        self._seek(further)

    def _finish(self) -> None:
        """Check the end of the file: after the data only indexes follow, and only their completeness matters."""
        self.stream.seek(max(0, self.size - len(MAGIC)))
        self.finished = self.stream.read() == MAGIC
        self.position = self.size

    def _record(self, opcode: int, body: bytes | memoryview) -> Iterator[McapRecord]:
        try:
            if opcode == Opcode.MESSAGE:
                channel, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(body)
                yield Message(channel, log_time, bytes(body[MESSAGE_HEAD.size :]), publish_time, sequence)
            elif opcode in _READERS:
                yield _READERS[opcode](ReadDataStream(BytesIO(body)))
        except UNREADABLE:
            self.dropped += HEAD.size + len(body)

    def _chunk(self, body: bytes, whole: bool) -> Iterator[McapRecord]:
        """Yield the records of a chunk: all of a whole one with a right checksum, the whole ones of a cut one."""
        try:
            data = open_chunk(body) if whole else _opened_part(body)
        except UNREADABLE:
            self.dropped += HEAD.size + len(body)
            return
        used = 0
        try:
            for opcode, record in chunk_records(data):
                yield from self._record(opcode, record)
                used += HEAD.size + len(record)
        except ValueError:
            # Of the packed bytes, the part whose content is no record counts as lost.
            self.dropped += max(1, round(len(body) * (1 - used / len(data))))
        if not len(data) and not whole:
            self.dropped += len(body)


@dataclass(frozen=True)
class FileIndex:
    """The content of the index at the end of a file, for parts of the data that are lost.

    Attributes:
        chunks: Places of its chunks, ascending.
        schemas: Schema id -> schema.
        channels: Channel id -> channel.
    """

    chunks: tuple[int, ...] = ()
    schemas: Mapping[int, Schema] = field(default_factory=dict)
    channels: Mapping[int, Channel] = field(default_factory=dict)


def read_index(stream: IO[bytes], size: int) -> FileIndex:
    """Return the index of a file; an empty one if it has none that can be read."""
    chunks: list[int] = []
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    try:
        for opcode, body in summary_records(stream, size, len(MAGIC)):
            if opcode == Opcode.CHUNK_INDEX:
                chunks.append(ChunkIndex.read(ReadDataStream(BytesIO(body))).chunk_start_offset)
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(body)))
                schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(body)))
                channels[channel.id] = channel
    except UNREADABLE:
        return FileIndex()
    return FileIndex(tuple(sorted(chunks)), schemas, channels)


def _opened_part(body: bytes) -> memoryview:
    """Return what a cut chunk holds; its checksum says nothing.

    Raises:
        ValueError: Its size is out of bounds.
        KeyError, RuntimeError, zstandard.ZstdError, struct.error: It cannot be unpacked.
    """
    _, _, size, _, name = CHUNK_HEAD.unpack_from(body)
    if size > LARGEST_CHUNK:
        raise ValueError("too large")
    start = CHUNK_HEAD.size + name
    return memoryview(unpack(body[CHUNK_HEAD.size : start].decode(), body[start + LENGTH.size :], size))

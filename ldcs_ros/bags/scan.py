"""A reader of damaged MCAP files, record by record from the start as far as possible."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")
_LENGTH = struct.Struct("<Q")
_MESSAGE = struct.Struct("<HIQQ")
_LARGEST_OPCODE = 0x0F
_PRIVATE_OPCODES = 0x80

_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}
_BROKEN_CHUNK = (
    struct.error,
    UnicodeDecodeError,
    KeyError,
    RuntimeError,
    zstandard.ZstdError,
    MemoryError,  # a chunk whose length is wrong may claim to be of any size
    OverflowError,
)


@dataclass
class Scan:
    """An iterator over the records with content; its counters then describe the damage.

    Args:
        stream: The file, at its start.
        size: Its length [bytes].
        progress: Called with the position before each record outside chunks.

    Attributes:
        position: Bytes read so far.
        dropped: Bytes of whole or cut records that could not be used [bytes].
        finished: The file had its footer and closing mark.
    """

    stream: IO[bytes]
    size: int
    progress: Callable[[int], None] | None = None
    position: int = 0
    dropped: int = 0
    finished: bool = False

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield header, schemas, channels, messages, attachments and metadata in file order; chunks are opened.

        The iteration ends at the summary, at a cut, or at the first invalid record.
        """
        if self._read(len(MAGIC)) != MAGIC:
            self.dropped = self.size
            return
        while self.position < self.size:
            if self.progress is not None:
                self.progress(self.position)
            head = self._read(_HEAD.size)
            if len(head) < _HEAD.size:
                self.dropped += len(head)
                return
            opcode, length = _HEAD.unpack(head)
            if not _is_opcode(opcode):
                self.dropped += len(head) + self.size - self.position
                return
            if opcode == Opcode.DATA_END:
                self._finish()
                return
            body = self._read(min(length, self.size - self.position))
            whole = len(body) == length
            if opcode == Opcode.CHUNK:
                yield from self._chunk(body, whole)
            elif whole:
                yield from self._record(opcode, body)
            elif opcode == Opcode.MESSAGE or opcode in _READERS:  # a cut index is no loss: it is made again
                self.dropped += len(head) + len(body)

    def _read(self, length: int) -> bytes:
        data = self.stream.read(length)
        self.position += len(data)
        return data

    def _finish(self) -> None:
        """Check the end of the file: after the data only indexes follow, and only their completeness matters."""
        self.stream.seek(max(0, self.size - len(MAGIC)))
        self.finished = self.stream.read() == MAGIC
        self.position = self.size

    def _record(self, opcode: int, body: bytes) -> Iterator[McapRecord]:
        try:
            if opcode == Opcode.MESSAGE:
                channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
                yield Message(channel, log_time, body[_MESSAGE.size :], publish_time, sequence)
            elif opcode in _READERS:
                yield _READERS[opcode](ReadDataStream(BytesIO(body)))
        except (struct.error, UnicodeDecodeError, McapError):
            self.dropped += _HEAD.size + len(body)

    def _chunk(self, body: bytes, whole: bool) -> Iterator[McapRecord]:
        """The records of a chunk: all of a whole one with a right checksum, the whole ones of a cut one."""
        try:
            _, _, size, checksum = _CHUNK.unpack_from(body)
            name_length = struct.unpack_from("<I", body, _CHUNK.size)[0]
            name_end = _CHUNK.size + 4 + name_length
            compression = body[_CHUNK.size + 4 : name_end].decode()
            data = _decompress(compression, body[name_end + _LENGTH.size :], size, whole)
        except _BROKEN_CHUNK:
            self.dropped += _HEAD.size + len(body)
            return
        if whole and (len(data) != size or (checksum and zlib.crc32(data) != checksum)):
            self.dropped += _HEAD.size + len(body)
            return
        used = 0
        while used + _HEAD.size <= len(data):
            opcode, length = _HEAD.unpack_from(data, used)
            end = used + _HEAD.size + length
            if not _is_opcode(opcode) or end > len(data):
                break
            yield from self._record(opcode, data[used + _HEAD.size : end])
            used = end
        if not whole:
            # of a cut chunk that was compressed, the part of its text that is no record counts as lost
            self.dropped += round(len(body) * (1 - used / len(data))) if data else len(body)


def _is_opcode(opcode: int) -> bool:
    return 0 < opcode <= _LARGEST_OPCODE or opcode >= _PRIVATE_OPCODES


def _decompress(compression: str, data: bytes, size: int, whole: bool) -> bytes:
    """All of a whole stream; of a cut one as much as comes out, which is its whole blocks.

    Raises:
        KeyError: A compression that MCAP does not name.
        RuntimeError, zstandard.ZstdError: Not such a stream, or one said to be whole that is not.
    """
    if compression == "zstd":
        if whole:
            return zstandard.decompress(data, max_output_size=size)
        return bytes(zstandard.ZstdDecompressor().decompressobj().decompress(data))
    if compression == "lz4":
        if whole:
            return bytes(lz4.frame.decompress(data))
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data))
    return {"": data}[compression]

"""The records of MCAP files: their layouts, and those of chunks and summaries."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import IO, NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from ldcs_ros.bags.limits import LARGEST_CHUNK, unpack

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
CHUNK_HEAD = struct.Struct("<QQQII")
"""Earliest and latest log time, unpacked size, checksum, length of the compression's name."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence number, log time, publish time."""
LENGTH = struct.Struct("<Q")
CHECKSUM = struct.Struct("<I")
FOOTER = struct.Struct("<BQQQI8s")
"""Opcode, length, start of the summary, start of its offsets, checksum, closing mark."""
SUMMED_FOOTER = 1 + 8 + 8 + 8
"""Bytes of the footer that its checksum covers."""
COMPRESSIONS = (b"", b"zstd", b"lz4")
LARGEST_OPCODE = 0x0F
PRIVATE_OPCODES = 0x80
UNREADABLE = (
    struct.error,
    UnicodeDecodeError,
    KeyError,
    RuntimeError,
    ValueError,
    zstandard.ZstdError,
    McapError,
    MemoryError,
    OverflowError,
)
"""Errors of the libraries on bytes that are no sound record."""


class Record(NamedTuple):
    """A record: its opcode and its body."""

    opcode: int
    body: memoryview


def is_opcode(opcode: int) -> bool:
    """Return whether MCAP names an opcode or leaves it to applications."""
    return 0 < opcode <= LARGEST_OPCODE or opcode >= PRIVATE_OPCODES


def open_chunk(body: bytes) -> memoryview:
    """Return the unpacked records of a whole chunk.

    Raises:
        ValueError: Its size, bound or checksum is wrong.
        KeyError, RuntimeError, zstandard.ZstdError: It cannot be unpacked.
    """
    _, _, size, checksum, name = CHUNK_HEAD.unpack_from(body)
    if size > LARGEST_CHUNK:
        raise ValueError(f"it claims {size} bytes, expected at most {LARGEST_CHUNK}")
    start = CHUNK_HEAD.size + name
    compression = body[CHUNK_HEAD.size : start].decode()
    if compression.encode() not in COMPRESSIONS:
        raise ValueError(f"got the compression {compression[:20]!r}, expected zstd, lz4 or none")
    data = unpack(compression, body[start + LENGTH.size :], size)
    if len(data) != size:
        raise ValueError(f"it claims {size} bytes and unpacks to {'more' if len(data) > size else len(data)}")
    if checksum and zlib.crc32(data) != checksum:
        raise ValueError("its checksum is wrong")
    return memoryview(data)


def chunk_records(data: memoryview) -> Iterator[Record]:
    """Yield the records of an unpacked chunk.

    Raises:
        ValueError: A record is none, or does not fit; those before it were yielded.
    """
    used = 0
    while used < len(data):
        if used + HEAD.size > len(data):
            raise ValueError(f"{len(data) - used} bytes at its end are no record")
        opcode, length = HEAD.unpack_from(data, used)
        start = used + HEAD.size
        if not is_opcode(opcode) or length > len(data) - start:
            raise ValueError(f"a record of {length} bytes inside of it does not fit")
        yield Record(opcode, data[start : start + length])
        used = start + length


def summary_records(stream: IO[bytes], size: int, data_end: int) -> Iterator[Record]:
    """Yield the records of a file's summary; nothing if it has none.

    Raises:
        ValueError: Its bounds or its checksum are wrong.
    """
    end = size - FOOTER.size
    stream.seek(max(0, end))
    footer = stream.read()
    opcode, _, start, _, checksum, _ = FOOTER.unpack(footer)
    if opcode != Opcode.FOOTER or start == 0:
        return
    if not data_end <= start <= end or end - start > LARGEST_CHUNK:
        raise ValueError("the summary is not at the place that the footer names")
    stream.seek(start)
    summary = stream.read(end - start)
    if checksum and zlib.crc32(summary + footer[:SUMMED_FOOTER]) != checksum:
        raise ValueError("the checksum of the summary is wrong")
    yield from chunk_records(memoryview(summary))

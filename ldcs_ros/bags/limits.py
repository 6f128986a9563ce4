"""Bounds of what a file of a bag may ask for, checked before memory or time is spent on it."""

from __future__ import annotations

import os
import stat
from io import BytesIO
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from ldcs_ros.errors import RecordingError, one_line

LARGEST_CHUNK = 128 * 2**20
"""Bytes of a chunk, packed or unpacked, and of a message; rosbag2 writes chunks of 1 MB."""
LARGEST_METADATA = 4 * 2**20
"""Bytes of metadata.yaml and of a metadata record."""
LARGEST_DEFINITION = 2**19
"""Bytes of the definition of a message type."""
_LARGEST_WINDOW = 2**27


def check_regular(file: Path) -> int:
    """Return the size of a regular file [bytes].

    Raises:
        RecordingError: There is no such file, or it is a pipe, a device or a folder.
    """
    try:
        status = os.stat(file)
    except OSError as error:
        raise RecordingError(f"{file} cannot be read: {one_line(error)}") from error
    if not stat.S_ISREG(status.st_mode):
        raise RecordingError(f"{file} is no regular file; expected a file on a disk")
    return status.st_size


def unpack(compression: str, data: bytes, size: int) -> bytes:
    """Return the unpacked bytes of a whole zstd, lz4 or uncompressed block, at most `size` and one more.

    Raises:
        KeyError: The compression is none that MCAP names.
        RuntimeError, zstandard.ZstdError: The data is no such block.
    """
    if compression == "zstd":
        unpacker = zstandard.ZstdDecompressor(max_window_size=_LARGEST_WINDOW)
        with unpacker.stream_reader(BytesIO(data), read_across_frames=True) as reader:
            return bytes(reader.read(size + 1))
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    return {"": data}[compression]

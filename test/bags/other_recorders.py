"""Small bags as other recorders write them, with any option of their storage."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, IndexType, Writer

FLUID = "sensor_msgs/msg/FluidPressure"
FLUID_TEXT = b"std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n" + b"".join(
    b"=" * 80 + b"\nMSG: " + name + b"\n" + text
    for name, text in (
        (b"std_msgs/Header", b"builtin_interfaces/Time stamp\nstring frame_id\n"),
        (b"builtin_interfaces/Time", b"int32 sec\nuint32 nanosec\n"),
    )
)
WALL = 1_700_000_000_000_000_000
STEP = 500_000_000
# rosbag2's options for MCAP files, and what the format allows beside them.
OPTIONS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "no_chunks": {"use_chunking": False},
    "no_message_index": {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
    "no_index": {"index_types": IndexType.NONE, "use_summary_offsets": False},
    "no_repeated_channels": {"repeat_channels": False},
    "no_repeated_schemas": {"repeat_schemas": False},
    "no_statistics": {"use_statistics": False},
    "no_summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no_checksums": {"enable_crcs": False},
    "small_chunks": {"chunk_size": 60},
}


def pressure(stamp: int, value: float) -> bytes:
    """Return the CDR of a FluidPressure."""
    return (
        b"\0\1\0\0"
        + struct.pack("<iII", stamp // 10**9, stamp % 10**9, 1)
        + bytes(4)
        + struct.pack("<dd", value, 0)
    )


def write_mcap(
    path: Path,
    times: list[int] | None = None,
    *,
    profile: str = "ros2",
    encoding: str = "cdr",
    beside: str = "",
    also: str = "",
    definition: tuple[str, bytes] = ("ros2msg", FLUID_TEXT),
    contents: list[bytes] | None = None,
    **options: Any,
) -> Path:
    """Write pressures of 1 and 2 kPa above ambient in turn, six of them if no log times [ns] are given.

    Args:
        path: The file.
        times: Log times [ns].
        profile: Profile of the file.
        encoding: Encoding of the messages.
        beside: Encoding of a second channel on another topic.
        also: Type of a second channel on the same topic.
        definition: Encoding and text of the type's definition.
        contents: Bytes of the messages.
        options: Those of the writer.
    """
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile=profile)
        schema = writer.register_schema(FLUID, *definition)
        channel = writer.register_channel("/v", encoding, schema)
        if beside:
            other = writer.register_channel(
                "/log", beside, writer.register_schema("Log", f"{beside}schema", b"{}")
            )
            writer.add_message(other, WALL, b"{}", WALL)
        if also:
            other = writer.register_channel("/v", encoding, writer.register_schema(also, "", b""))
            writer.add_message(other, WALL, b"", WALL)
        for k, time in enumerate([WALL + k * STEP for k in range(6)] if times is None else times):
            data = pressure(WALL + k * STEP, 102325.0 + 1e3 * (k % 2)) if contents is None else contents[k]
            writer.add_message(channel, time, data, time, k)
        writer.add_attachment(WALL, WALL, "notes.txt", "text/plain", b"a file inside of a bag")
        writer.finish()
    return path


def write_sqlite3(path: Path, values: list[float], *, in_wal: int = 0) -> Path:
    """Write pressures [Pa] into a sqlite3 file of schema version 3; the last `in_wal` stay in the -wal file."""
    live = path.with_suffix(".live")
    database = sqlite3.connect(live)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA wal_autocheckpoint = 0")
    database.executescript(
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
        " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
        "INSERT INTO schema VALUES (3, 'humble');"
    )
    database.execute("INSERT INTO topics VALUES (1, '/v', ?, 'cdr', '')", (FLUID,))
    for k, value in enumerate(values):
        if k == len(values) - in_wal:
            database.commit()
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        time = WALL + k * STEP
        database.execute("INSERT INTO messages VALUES (?, 1, ?, ?)", (k + 1, time, pressure(time, value)))
    database.commit()
    if not in_wal:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    # Copied while it is open: what is in the -wal file stays there.
    path.write_bytes(live.read_bytes())
    if in_wal:
        path.with_name(f"{path.name}-wal").write_bytes(live.with_name(f"{live.name}-wal").read_bytes())
    database.close()
    live.unlink()
    return path


def card(folder: Path, files: list[str], count: int, *, storage: str = "mcap", compression: str = "") -> Path:
    """Write a metadata.yaml into a folder and return the folder."""
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n"
        f"  storage_identifier: {storage}\n  message_count: {count}\n"
        f"  compression_format: {'zstd' if compression else ''}\n  compression_mode: {compression or 'NONE'}\n"
        f"  relative_file_paths: {files}\n"
    )
    return folder

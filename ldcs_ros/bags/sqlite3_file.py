"""One sqlite3 file of a bag for reading, of every schema version of rosbag2, what its -wal file holds included."""

from __future__ import annotations

import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from ldcs_ros.bags.limits import LARGEST_CHUNK, check_regular
from ldcs_ros.bags.storage import LATEST, Definition, StoredChannel
from ldcs_ros.bags.topics import TopicInfo, parse_qos
from ldcs_ros.errors import RecordingError, one_line

MAGIC = b"SQLite format 3\0"
_TABLES = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("id", "topic_id", "timestamp", "data"),
}


class Sqlite3File:
    """A sqlite3 file, open for reading; it is never written.

    Args:
        path: The file; it is opened again at each pass.

    Attributes:
        channels: Id -> channel.
        start: Earliest log time [ns]; 0 without messages.
        end: Latest log time [ns]; 0 without messages.
        custom_data: Empty: the file itself holds none.

    Raises:
        RecordingError: The file is damaged, holds no bag, or its -wal file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.custom_data: Mapping[str, str] = {}
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self._uri = f"file:{quote(str(path.resolve()))}?mode=ro"
        try:
            self._uri = self._readable()
            with closing(self._open()) as database:
                self._check_tables(database)
                self.channels: Mapping[int, StoredChannel] = _channels(database)
                lost, kinds = database.execute(
                    "SELECT count(*), count(CASE WHEN typeof(timestamp) != 'integer' OR "
                    "typeof(data) != 'blob' THEN 1 END) FROM messages "
                    "WHERE topic_id NOT IN (SELECT id FROM topics) OR typeof(timestamp) != 'integer' "
                    "OR typeof(data) != 'blob'"
                ).fetchone()
                start, end = database.execute(
                    "SELECT min(timestamp), max(timestamp) FROM messages"
                ).fetchone()
        except (sqlite3.Error, MemoryError, OverflowError, UnicodeDecodeError, OSError) as error:
            raise self._refusal(error) from error
        if lost:
            what = "that are none" if kinds else "of no topic"
            raise RecordingError(f"{path} is damaged: it has {lost} messages {what}; {_ADVICE}")
        self.start, self.end = start or 0, end or 0
        if self.start < 0 or self.end > LATEST:
            raise RecordingError(f"{path} has a log time of {self.start} ns, before 1970; nothing was read")

    def spans(self) -> Iterator[tuple[int, int]]:
        """Yield the time of each message twice [ns], from the index of times where the file has one.

        Raises:
            RecordingError: The file is damaged.
        """
        try:
            with closing(self._open()) as database:
                yield from database.execute("SELECT timestamp, timestamp FROM messages")
        except (sqlite3.Error, MemoryError, OverflowError) as error:
            raise self._refusal(error) from error

    def messages(self, wanted: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield (log time [ns], channel id, bytes) of some channels by log time, equal times in the order of writing.

        Raises:
            RecordingError: The file is damaged.
        """
        ids = ",".join(str(id) for id in sorted(wanted))
        try:
            with closing(self._open()) as database:
                yield from database.execute(
                    f"SELECT timestamp, topic_id, data FROM messages WHERE topic_id IN ({ids}) "
                    "ORDER BY timestamp, id"
                )
        except (sqlite3.Error, MemoryError, OverflowError) as error:
            raise self._refusal(error) from error

    def _readable(self) -> str:
        """Return the URI of the file, or of a copy where sqlite3 lacks the rights to read a -wal file beside it."""
        try:
            with closing(self._open()) as database:
                database.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError as error:
            if not str(error).startswith(_NO_RIGHTS):
                raise
            journal = self._path.with_name(f"{self._path.name}-wal")
            if not journal.exists() or not check_regular(journal):
                return f"{self._uri}&immutable=1"
            self._copy = tempfile.TemporaryDirectory(prefix="ldcs_bag_")
            for file in (self._path, journal):
                shutil.copyfile(file, Path(self._copy.name) / file.name)
            return f"file:{quote(str(Path(self._copy.name) / self._path.name))}?mode=ro"
        return self._uri

    def _open(self) -> sqlite3.Connection:
        # A path may hold the signs that separate the parts of a URI.
        database = sqlite3.connect(self._uri, uri=True)
        database.execute("PRAGMA trusted_schema = OFF")
        if sys.version_info >= (3, 11):
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CHUNK)
        return database

    def _check_tables(self, database: sqlite3.Connection) -> None:
        # A view in their place may compute without end.
        for table, columns in _TABLES.items():
            kinds = database.execute("SELECT type FROM sqlite_master WHERE name = ?", (table,)).fetchall()
            found = _columns(database, table) if kinds == [("table",)] else set()
            missing = sorted(set(columns) - found)
            if missing:
                raise RecordingError(
                    f"{self._path} is no ROS 2 bag: its table {table!r} is missing or lacks {missing}"
                )

    def _refusal(self, error: BaseException) -> RecordingError:
        journals = [
            journal.name
            for suffix in ("-wal", "-journal")
            if (journal := self._path.with_name(self._path.name + suffix)).exists()
        ]
        beside = f" (with {journals[0]} beside it)" if journals else ""
        return RecordingError(f"{self._path}{beside} cannot be read: {one_line(error)}; {_ADVICE}")


_NO_RIGHTS = ("unable to open", "attempt to write a readonly", "readonly")
"""Beginnings of sqlite3's words for a folder in which it cannot write."""
_ADVICE = "copy what can be read with `sqlite3 FILE .recover`, then `ros2 bag reindex`"


def _columns(database: sqlite3.Connection, table: str) -> set[str]:
    return {str(row[1]) for row in database.execute(f"PRAGMA table_info({table})")}


def _channels(database: sqlite3.Connection) -> dict[int, StoredChannel]:
    qos = "offered_qos_profiles" if "offered_qos_profiles" in _columns(database, "topics") else "''"
    definitions: dict[str, Definition] = {}
    if {"topic_type", "encoding", "encoded_message_definition"} <= _columns(database, "message_definitions"):
        definitions = {
            str(name): Definition(str(encoding), str(text))
            for name, encoding, text in database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            if encoding in ("ros2msg", "ros2idl")
        }
    counts = dict(database.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
    return {
        id: StoredChannel(
            str(name),
            TopicInfo(str(kind), parse_qos(str(profiles))),
            str(encoding),
            definitions.get(str(kind), Definition()),
            counts.get(id, 0),
        )
        for id, name, kind, encoding, profiles in database.execute(
            f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
        )
    }

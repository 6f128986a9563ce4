"""BagWriter: a run queues its messages, and a thread of the writer puts them on the disk."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import TracebackType

from ldcs_ros.bags.bag_file import CHUNK_SIZE, BagFile
from ldcs_ros.bags.durable import sync_folder
from ldcs_ros.bags.mcap_file import CUSTOM_DATA_RECORD
from ldcs_ros.bags.metadata import bag_information, write_metadata
from ldcs_ros.bags.schemas import Schema, Schemas
from ldcs_ros.bags.topics import TopicInfo
from ldcs_ros.errors import RecordingError, one_line, user_path

QUEUE_LIMIT = 32 << 20
"""Bytes that wait for the disk before `write` blocks: minutes of the paper scene."""
SYNC_PERIOD = 5.0
"""Wall time between two waits for the disk itself [s]."""
REST = "_rest"
MAX_RESTS = 9
"""Folders that a disturbed recording may go on in."""
CLOSE_TIMEOUT = 30.0
"""Wall time that `close` gives a disk that does not answer [s]."""


@dataclass
class _Channel:
    """A recorded topic; the writing thread gives the id with the declaration of the channel."""

    topic: str
    info: TopicInfo
    schema: Schema
    id: int | None = None


class BagWriter:
    """A recorder of messages into a new bag folder: MCAP that `ros2 bag` accepts, and metadata.yaml at the end.

    A recording survives failures as follows:

    1. `write` only appends to a queue. It blocks, and loses nothing, while more than QUEUE_LIMIT bytes wait.
    2. Every `flush_period` of wall time the thread ends the chunk and hands it to the operating system. A kill loses
       at most that period and the time to write it.
    3. Every SYNC_PERIOD, and at the end, the thread waits for the disk itself (fdatasync). A power cut loses seconds,
       not the 30 s that Linux may hold back, and network disks report their errors. More often would wear the disk
       and gain little, since a machine fails far less often than a process.
    4. A disk that fills up or fails ends the recording, not the run: `error` then holds one line, later
       messages are counted in `lost` and what was flushed stays readable after `ldcs recover`.
    5. A folder or file that is removed, renamed, replaced or cut is noticed at the next flush. `error` says so, and
       the rest goes into `<folder>_rest1`, where that can be made.
    6. Only `close` writes metadata.yaml. Before that no reader takes the folder for a whole bag (early metadata would
       say "0 messages"). The MCAP file begins with custom_data and the offered quality of service: the bag of a
       killed run has them.

    Several threads may write. A writer that was not closed is closed when the interpreter exits.

    Args:
        folder: Bag folder, created here with its parents.
        topics: Topic name -> TopicInfo of what will be recorded; these are listed even when nothing comes.
        custom_data: Texts by name that say how to run it again.
        definitions: `package/msg/Name` -> .msg text of types that ROS 2 Kilted does not have.
        flush_period: Wall time between two flushes [s].

    Raises:
        RecordingError: The folder exists, cannot be created or written, or a message type is unknown;
            nothing is left on the disk.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        topics: Mapping[str, TopicInfo],
        custom_data: Mapping[str, str] | None = None,
        definitions: Mapping[str, str] | None = None,
        flush_period: float = 0.5,
    ) -> None:
        self.folder = user_path(folder)
        self.custom_data = _texts(custom_data or {})
        self.flush_period = flush_period
        self._schemas = Schemas(definitions)
        self._channels = {
            name: _Channel(name, TopicInfo(info.type, info.qos), self._schemas[info.type])
            for name, info in topics.items()
        }
        self._condition = threading.Condition(threading.Lock())
        self._pending: list[tuple[_Channel, bytes, int]] = []
        self._pending_bytes = 0
        self._accepted = 0
        self._flushed = 0
        self._lost = 0
        self._last_time = 0
        self._closing = False
        self._stopped = False
        self._unchecked: list[tuple[_Channel, bytes, int]] = []
        self._error: str | None = None
        self._file = self._open()
        self._thread = threading.Thread(target=self._run, name=f"bag {self.folder.name}", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    def register(self, definitions: Mapping[str, str]) -> None:
        """Add message types: `package/msg/Name` -> .msg text, for topics that begin during the recording."""
        with self._condition:
            self._schemas.register(definitions)

    def add_custom_data(self, texts: Mapping[str, str]) -> None:
        """Add texts that are known at the end of a run: metadata.yaml holds them, the file's beginning does not."""
        with self._condition:
            self.custom_data |= _texts(texts)

    def write(self, topic: str, message_type: str, cdr: bytes | bytearray | memoryview, time_ns: int) -> None:
        """Queue a message; failures of the disk never raise here, see `error`.

        Args:
            topic: Topic name; one that was not announced is recorded with default quality of service.
            message_type: `package/msg/Name`.
            cdr: The serialised message with its encapsulation header.
            time_ns: Log time [ns], >= 0; times need not ascend.

        Raises:
            RecordingError: A mistake of the caller: unknown type, another type than before, negative time.
        """
        channel = self._channels.get(topic)
        if channel is None or channel.info.type != message_type:
            channel = self._declare(topic, message_type)
        if time_ns < 0:
            raise RecordingError(f"message on {topic} has log time {time_ns} ns; a bag holds times >= 0 only")
        data = bytes(cdr)
        with self._condition:
            while self._pending_bytes > QUEUE_LIMIT and not self._stopped and not self._closing:
                self._condition.wait()
            if self._stopped or self._closing:
                self._lost += 1
                return
            self._pending.append((channel, data, int(time_ns)))
            self._accepted += 1
            self._pending_bytes += len(data)
            if self._pending_bytes > CHUNK_SIZE:
                self._condition.notify_all()

    def close(self) -> None:
        """Write the queue, the summary and metadata.yaml; it always ends, never raises and may be repeated."""
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        self._thread.join(CLOSE_TIMEOUT)
        if self._thread.is_alive():
            self._fail(OSError(f"the disk does not answer within {CLOSE_TIMEOUT:.0f} s"))
        atexit.unregister(self.close)

    @property
    def error(self) -> str | None:
        """The reason of a stop, in one line; None while all is well."""
        return self._error

    @property
    def count(self) -> int:
        """Messages accepted by `write`."""
        return self._accepted

    @property
    def lost(self) -> int:
        """Messages that are not in the bag: those after the last flush before a failure, those before a disturbance."""
        return self._lost

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _open(self) -> BagFile:
        """Make the folder and the MCAP file with all content before the first message."""
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(_unwritable(self.folder, error)) from error
        return self._file_in(self.folder)

    def _file_in(self, folder: Path) -> BagFile:
        path = folder / f"{folder.name}_0.mcap"
        try:
            folder.mkdir()
        except FileExistsError as error:
            raise RecordingError(
                f"the bag folder {folder} exists already and is never overwritten; "
                "give another name or remove it first"
            ) from error
        except OSError as error:
            raise RecordingError(_unwritable(folder, error)) from error
        file = None
        try:
            file = BagFile(path)
            file.add_metadata(CUSTOM_DATA_RECORD, self.custom_data)
            for channel in self._channels.values():
                channel.id = file.add_topic(channel.topic, channel.info, channel.schema)
            file.flush()
            sync_folder(folder)
        except OSError as error:
            if file is not None:
                file.abandon()
            path.unlink(missing_ok=True)
            folder.rmdir()
            raise RecordingError(_unwritable(folder, error)) from error
        return file

    def _declare(self, topic: str, message_type: str) -> _Channel:
        with self._condition:
            channel = self._channels.get(topic)
            if channel is None:
                channel = _Channel(topic, TopicInfo(message_type), self._schemas[message_type])
                self._channels[topic] = channel
        if channel.info.type != message_type:
            raise RecordingError(
                f"topic {topic} is recorded as {channel.info.type}, got a message of type {message_type}; "
                "a topic has one type in a bag"
            )
        return channel

    def _run(self) -> None:
        """Run the writing thread; any failure ends in `error`, so that no caller waits for it forever."""
        try:
            self._record()
            self._file.flush()
            self._check()
            information = bag_information([self._file.summary()], self.custom_data)
            self._file.finish(information)
            self._flushed = self._file.count
            write_metadata(self.folder, information)
        except Exception as error:
            self._fail(error)
        finally:
            self._file.abandon()

    def _record(self) -> None:
        next_flush = monotonic() + self.flush_period
        next_sync = monotonic() + SYNC_PERIOD
        closing = False
        while not closing:
            with self._condition:
                self._condition.wait_for(self._is_due, timeout=max(0.0, next_flush - monotonic()))
                batch, self._pending = self._pending, []
                self._pending_bytes = 0
                closing = self._closing
                self._condition.notify_all()
            for channel, data, time in batch:
                if channel.id is None:
                    channel.id = self._file.add_topic(channel.topic, channel.info, channel.schema)
                self._file.add_message(channel.id, data, time)
                self._last_time = time
            self._unchecked += batch
            if monotonic() >= next_flush:
                self._file.flush()
                self._flushed = self._file.count
                self._check()
                next_flush = monotonic() + self.flush_period
            if monotonic() >= next_sync:
                self._file.sync()
                next_sync = monotonic() + SYNC_PERIOD

    def _check(self) -> None:
        # A file that was removed or renamed takes all bytes without an error; only its path tells.
        try:
            self._file.check()
        except OSError as error:
            lost = f"recording to {self.folder} was disturbed at {self._last_time / 1e9:.3f} s: {one_line(error)}"
            first = self.folder.name.partition(REST)[0]
            folders = (self.folder.with_name(f"{first}{REST}{k}") for k in range(1, MAX_RESTS + 1))
            folder = next((one for one in folders if not one.exists()), None)
            if folder is None:
                raise
            file, self._file = self._file, self._file_in(folder)
            kept = file.count - len(self._unchecked)
            file.abandon()
            for channel, data, time in self._unchecked:
                assert channel.id is not None  # the new file has a channel of each
                self._file.add_message(channel.id, data, time)
            self._file.flush()
            with self._condition:
                self._lost += kept
                self._error = self._error or f"{lost}; the rest is saved in {folder}"
            self._flushed, self.folder = self._file.count, folder
        self._unchecked.clear()

    def _is_due(self) -> bool:
        return self._closing or self._pending_bytes > CHUNK_SIZE

    def _fail(self, error: Exception) -> None:
        with self._condition:
            if self._error is None:
                self._error = (
                    f"recording to {self.folder} stopped at {self._last_time / 1e9:.3f} s: {one_line(error)}; "
                    f"at least {self._flushed} messages are kept: "
                    f"repair the disk, then `ldcs recover {self.folder}`"
                )
                self._lost += self._accepted - self._flushed
            self._stopped = True
            self._pending.clear()
            self._condition.notify_all()


def _texts(custom_data: Mapping[str, str]) -> dict[str, str]:
    for key, value in custom_data.items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise RecordingError(
                f"custom_data[{key!r}] must be a text, got {type(value).__name__}; rosbag2 carries texts only"
            )
    return dict(custom_data)


def _unwritable(folder: Path, error: OSError) -> str:
    return (
        f"the bag folder {folder} cannot be written: {one_line(error)}; give a folder that you may write to"
    )

"""A file of a bag of any storage: its channels, its span, its messages by log time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from ldcs_ros.bags.topics import TopicInfo

LATEST = 2**63 - 1
"""Latest log time [ns] that a recording may have: 2262."""


@dataclass(frozen=True)
class Definition:
    """The definition of a message type as a bag carries it.

    Attributes:
        encoding: `ros2msg` or `ros2idl`; '' when the bag carries none.
        text: The definition, those of the nested types included.
    """

    encoding: str = ""
    text: str = ""


@dataclass(frozen=True)
class StoredChannel:
    """A channel of one file.

    Attributes:
        topic: Topic name.
        info: Message type and offered quality of service.
        encoding: Encoding of its messages, such as `cdr`.
        definition: Definition of its message type.
        count: Its messages.
    """

    topic: str
    info: TopicInfo
    encoding: str
    definition: Definition
    count: int

    @property
    def is_ros(self) -> bool:
        """The channel holds ROS 2 messages."""
        return self.encoding == "cdr" and bool(self.info.type)


class StorageFile(Protocol):
    """One file of a bag, open for reading.

    Attributes:
        channels: Channel id -> channel.
        start: Earliest log time [ns]; 0 without messages.
        end: Latest log time [ns]; 0 without messages.
        custom_data: Texts that this package stored in the file itself.
    """

    @property
    def channels(self) -> Mapping[int, StoredChannel]: ...
    @property
    def start(self) -> int: ...
    @property
    def end(self) -> int: ...
    @property
    def custom_data(self) -> Mapping[str, str]: ...

    def spans(self) -> Iterator[tuple[int, int]]:
        """Yield intervals of log time [ns] that hold all messages, each with one at its beginning and its end.

        Raises:
            RecordingError: The file is damaged.
        """
        ...

    def messages(self, wanted: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield (log time [ns], channel id, bytes) of some channels by log time, equal times in the order of writing.

        Raises:
            RecordingError: The file is damaged, or holds less than it claims.
        """
        ...

"""Recording: channel -> times and messages; a run, a rig's bag and a run in memory are the same type."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.bags.topics import TopicInfo
from ldcs_ros.errors import RecordingError, one_line


class Message(NamedTuple):
    """One recorded message as it was on the wire.

    Attributes:
        topic: Topic name.
        type: `package/msg/Name`.
        cdr: Serialised message with its encapsulation header.
        time: Log time [ns].
    """

    topic: str
    type: str
    cdr: bytes
    time: int


# Any, here and below: the class of a message follows from the definition in its bag, so readers name its fields.
class Decoder(Protocol):
    """A decoder of bytes into message objects; a rosbags typestore is one."""

    def deserialize_cdr(self, rawdata: bytes, typename: str, /) -> Any: ...


class Source(Protocol):
    """A source of messages; a bag reads them again at each pass, so that they need not fit in memory."""

    @property
    def decoder(self) -> Decoder: ...

    def spans(self) -> Iterator[tuple[int, int]]:
        """Return intervals of log time [ns] that hold all messages, each with one at its beginning and its end."""
        ...

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Return messages of some topics (None = all) by log time; equal times keep the order of writing."""
        ...


@dataclass(frozen=True)
class Recording:
    """Channels of messages with their times.

    Attributes:
        name: Path of the bag, or its name in errors.
        topics: Topic name -> type and offered quality of service, also for topics without a message.
        counts: Topic name -> number of messages.
        custom_data: Texts of the recorder by name: scene, seed, version and others.
        start: Earliest log time [ns]; 0 when nothing was recorded.
        end: Latest log time [ns]; 0 when nothing was recorded.
        source: Source of the messages.
        notes: Omitted parts, in words.
    """

    name: str
    topics: Mapping[str, TopicInfo]
    counts: Mapping[str, int]
    custom_data: Mapping[str, str]
    start: int
    end: int
    source: Source
    notes: tuple[str, ...] = ()

    @cached_property
    def channels(self) -> Mapping[str, Channel]:
        """Topic name -> Channel; a channel reads its messages when first asked for them."""
        return {topic: Channel(topic, info, self.source, self.name) for topic, info in self.topics.items()}

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        return (self.end - self.start) / 1e9

    @property
    def count(self) -> int:
        """Messages in all channels."""
        return sum(self.counts.values())

    def spans(self) -> list[tuple[int, int]]:
        """Return intervals of log time [ns] that hold all messages, by time, from the indices of the files alone.

        Raises:
            RecordingError: A file is damaged.
        """
        return sorted(self.source.spans())

    def in_order(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Return every message of some topics (None = all) by log time; equal times keep the order of writing.

        Raises:
            RecordingError: A topic that the recording does not have; a file that is damaged on the way.
        """
        unknown = sorted(set(topics or ()) - set(self.topics))
        if unknown:
            raise RecordingError(f"{self.name} has no topic {unknown[0]!r}; it has {sorted(self.topics)}")
        return self.source.messages(topics)

    def load(self, topics: Collection[str]) -> None:
        """Read several channels in one pass over the file, at the cost of one of them.

        Raises:
            RecordingError: As `in_order`.
        """
        found: dict[str, list[Message]] = {topic: [] for topic in topics}
        for message in self.in_order(topics) if topics else ():
            found[message.topic].append(message)
        for topic, messages in found.items():
            # The place in which a cached property keeps its value.
            self.channels[topic].__dict__["raw"] = tuple(messages)

    def decode(self, message: Message) -> Any:
        """Return the message as an object with the fields of its type."""
        return _decode(self.source.decoder, message, self.name)

    @classmethod
    def from_messages(
        cls,
        messages: Iterable[Message],
        *,
        name: str = "a run in memory",
        custom_data: Mapping[str, str] | None = None,
    ) -> Recording:
        """Return a recording in memory, of messages in the order of their emission."""
        ordered = sorted(messages, key=lambda message: message.time)
        counts: dict[str, int] = {}
        topics: dict[str, TopicInfo] = {}
        for message in ordered:
            counts[message.topic] = counts.get(message.topic, 0) + 1
            topics.setdefault(message.topic, TopicInfo(message.type))
        start, end = (ordered[0].time, ordered[-1].time) if ordered else (0, 0)
        return cls(name, topics, counts, dict(custom_data or {}), start, end, _Memory(ordered))


@dataclass(frozen=True)
class Channel:
    """The messages of one topic, by log time.

    Attributes:
        topic: Topic name.
        info: Message type and offered quality of service.
    """

    topic: str
    info: TopicInfo
    source: Source
    recording: str

    @property
    def type(self) -> str:
        """Message type, `package/msg/Name`."""
        return self.info.type

    @cached_property
    def raw(self) -> Sequence[Message]:
        """The messages as bytes, by log time."""
        return tuple(self.source.messages([self.topic]))

    @cached_property
    def times(self) -> NDArray[np.int64]:
        """Log times, ascending [ns], shape (n_messages,)."""
        return np.array([message.time for message in self.raw], dtype=np.int64)

    @property
    def messages(self) -> Sequence[Any]:
        """The messages as objects with the fields of their type, each decoded when it is taken."""
        return _Decoded(self.raw, self.source, self.recording)

    def __len__(self) -> int:
        return len(self.raw)


@dataclass(frozen=True)
class _Decoded(Sequence[Any]):
    """A view of raw messages that decodes on access."""

    raw: Sequence[Message]
    source: Source
    recording: str

    def __len__(self) -> int:
        return len(self.raw)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return _Decoded(self.raw[index], self.source, self.recording)
        return _decode(self.source.decoder, self.raw[index], self.recording)


class _Memory:
    """Messages held in a list."""

    def __init__(self, ordered: Sequence[Message]) -> None:
        self._ordered = ordered

    @cached_property
    def decoder(self) -> Decoder:
        return Schemas().typestore

    def spans(self) -> Iterator[tuple[int, int]]:
        return ((message.time, message.time) for message in self._ordered)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        return (message for message in self._ordered if topics is None or message.topic in topics)


def _decode(decoder: Decoder, message: Message, recording: str) -> Any:
    try:
        return decoder.deserialize_cdr(message.cdr, message.type)
    except RecordingError:
        raise
    except Exception as error:  # a foreign message may break the decoder anywhere
        raise RecordingError(
            f"{recording}: the message on {message.topic} at {message.time * 1e-9:.6f} s "
            f"is no valid {message.type}: {one_line(error)}"
        ) from error

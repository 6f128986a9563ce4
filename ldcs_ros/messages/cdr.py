"""ROS messages as bytes (CDR, little endian) by the rosbags type store: no ROS installation needed."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any, cast

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ldcs_ros.bags.schemas import Schemas, own_definitions
from ldcs_ros.messages.message_types import MessageClass, RosMessage
from ldcs_ros.messages.ros_types import ros_types

# The stamp of a message that begins with a header follows the four bytes that name the encoding.
_STAMP = struct.Struct("<iI")
_STAMP_OFFSET = 4
_PLACEHOLDER = 0xA5


@lru_cache(maxsize=1)
def _own_types() -> Typestore:
    store = get_typestore(Stores.EMPTY)
    types = ros_types()
    for name, text in own_definitions().items():
        types |= get_types_from_msg(text, name)
    store.register(types)
    return store


@lru_cache(maxsize=1)
def _all_types() -> Typestore:
    return Schemas().typestore


def typestore(message_type: str) -> Typestore:
    """Return definitions that contain a type: those of the twin, or all of ROS 2 Kilted.

    Those of the twin are the same in Humble to Rolling.
    """
    known = _own_types()
    return known if message_type in known.fielddefs else _all_types()


def message_class(message_type: str) -> MessageClass:
    """Return the class of a type such as 'std_msgs/msg/Header'."""
    return cast(MessageClass, typestore(message_type).types[message_type])


def encode(message: RosMessage) -> bytes:
    """Return the CDR bytes of a message object."""
    return bytes(typestore(message.__msgtype__).serialize_cdr(message, message.__msgtype__))


def decode(message_type: str, cdr: bytes) -> Any:  # its fields follow from the type's name at run time
    """Return the message object of CDR bytes; foreign bytes raise exceptions of many kinds."""
    return typestore(message_type).deserialize_cdr(cdr, message_type)


def nanoseconds(time: float) -> int:
    """Return a time [s] in nanoseconds, rounded to the nearest."""
    return round(time * 1e9)


def time_message(time_ns: int) -> RosMessage:
    """Return builtin_interfaces/Time."""
    sec, nanosec = divmod(time_ns, 1_000_000_000)
    return message_class("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)


def header(time_ns: int, frame: str) -> RosMessage:
    """Return std_msgs/Header."""
    return message_class("std_msgs/msg/Header")(stamp=time_message(time_ns), frame_id=frame)


def placeholder(size: int) -> np.ndarray:
    """Return the bytes that mark the block which a `MessageTemplate` fills, shape (size,)."""
    return np.full(size, _PLACEHOLDER, dtype=np.uint8)


class MessageTemplate:
    """A large message of constant layout: encoded once, then only its stamp and some blocks are written.

    Args:
        message: RosMessage object that begins with a header and holds `placeholder(size)` in place of each block.
        sizes: Length of each block in the order of the message [bytes].
    """

    def __init__(self, message: RosMessage, *sizes: int) -> None:
        self._bytes = bytearray(encode(message))
        self._blocks: list[slice] = []
        end = 0
        for size in sizes:
            start = self._bytes.find(placeholder(size).tobytes(), end)
            if start < 0:
                raise ValueError(f"{message.__msgtype__} does not hold a block of {size} bytes")
            end = start + size
            self._blocks.append(slice(start, end))

    def fill(self, time_ns: int, *blocks: np.ndarray) -> bytes:
        """Return the message with this stamp and these blocks (contiguous, of the right sizes)."""
        _STAMP.pack_into(self._bytes, _STAMP_OFFSET, *divmod(time_ns, 1_000_000_000))
        for place, block in zip(self._blocks, blocks, strict=True):
            self._bytes[place] = block.view(np.uint8).reshape(-1).data
        return bytes(self._bytes)

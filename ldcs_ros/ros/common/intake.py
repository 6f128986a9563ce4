"""Taking commands off the wire: everything that waits at once, and what was overwritten in the queue is counted."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.subscription import Subscription

# An executor looks at all its work between two messages; a flood is taken in handfuls, and others get their turn.
_HANDFUL = 100
_PUBLISHERS = 256


class Intake:
    """The callback of a raw subscription.

    A queue that is full drops its oldest messages without a word; the numbers that publishers give their messages
    tell how many. Middleware that hands on no such numbers leaves `missed` at zero.

    Args:
        receive: Gets the bytes of each message.

    Attributes:
        subscription: To be set once the subscription stands.
        missed: Messages that were overwritten before they could be taken.
    """

    def __init__(self, receive: Callable[[bytes], None]) -> None:
        self.subscription: Subscription[Any] | None = None
        self.missed = 0
        self._receive = receive
        self._latest: OrderedDict[bytes, int] = OrderedDict()

    def __call__(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        """Hand on a message, and those that wait behind it."""
        self._take(cdr, info)
        subscription = self.subscription
        if subscription is None:
            return
        with subscription.handle:
            for _ in range(_HANDFUL):
                taken: Any = subscription.handle.take_message(subscription.msg_type, True)
                if taken is None:
                    return
                self._take(*taken)

    def _take(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        publisher, number = info.get("publisher_gid"), info.get("publication_sequence_number")
        if publisher is not None and number is not None:
            self._count(publisher["data"], number)
        self._receive(cdr)

    def _count(self, publisher: bytes, number: int) -> None:
        latest = self._latest.pop(publisher, number - 1)
        self.missed += max(0, number - latest - 1)
        self._latest[publisher] = number
        if len(self._latest) > _PUBLISHERS:
            self._latest.popitem(last=False)

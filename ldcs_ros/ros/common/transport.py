"""The wire: publishers and subscriptions that carry the bytes of a twin as they are."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from ldcs_ros.messages.topics import Topic
from ldcs_ros.ros.common.optional import import_problem, message_type
from ldcs_ros.ros.common.qos import OPTIONS, profile, with_profile

# An executor looks at all its work between two messages; a flood is taken in handfuls, and others get their turn.
_BATCH_SIZE = 100
_PUBLISHERS = 256


class DrainingSubscription:
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
        """Hand on a message, and those that wait in the queue."""
        self._take(cdr, info)
        subscription = self.subscription
        if subscription is None:
            return
        with subscription.handle:
            for _ in range(_BATCH_SIZE):
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


class TopicTransport:
    """Carries messages between a twin and the graph; add it to the twin's sinks.

    Args:
        node: The node that owns publishers and subscriptions.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._publishers: dict[str, Publisher[Any]] = {}
        self._subscriptions: list[Subscription[Any]] = []
        self._callbacks: list[DrainingSubscription] = []
        self._opened: dict[str, Topic] = {}

    def open(self, topics: Iterable[Topic], receive: Callable[[str, bytes], None]) -> dict[str, Topic]:
        """Publish the outgoing topics; hand the bytes of incoming ones to `receive(topic, cdr)`.

        Topics whose message package cannot be used are left out; those that are open stay as they are.

        Returns:
            Those of the topics that are open, by name, each with the quality of service that it got.
        """
        asked = list(topics)
        for topic in asked:
            if topic.name in self._opened or import_problem(topic.type.split("/")[0]):
                continue
            kind, qos = message_type(topic.type), profile(topic)
            if topic.direction == "out":
                self._publishers[topic.name] = self._node.create_publisher(
                    kind, topic.name, qos, qos_overriding_options=OPTIONS
                )
            else:
                callback = DrainingSubscription(partial(receive, topic.name))
                callback.subscription = self._node.create_subscription(
                    kind, topic.name, callback, qos, qos_overriding_options=OPTIONS, raw=True
                )
                self._callbacks.append(callback)
                self._subscriptions.append(callback.subscription)
            self._opened[topic.name] = with_profile(topic, qos)
        return {topic.name: self._opened[topic.name] for topic in asked if topic.name in self._opened}

    def keep(self, topics: Iterable[str]) -> None:
        """Publish nothing but these topics any more."""
        for name in set(self._publishers) - set(topics):
            self._node.destroy_publisher(self._publishers.pop(name))
            del self._opened[name]

    def close(self) -> None:
        """Leave the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._publishers.clear()
        self._subscriptions.clear()
        self._callbacks.clear()
        self._opened.clear()

    @property
    def missed(self) -> int:
        """Commands that were overwritten in a full queue before they could be taken."""
        return sum(callback.missed for callback in self._callbacks)

    def has_subscribers(self, topic: str) -> bool:
        """Return whether a topic has subscribers."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        """Publish one message; commands that the twin emits are not ours to publish."""
        publisher = self._publishers.get(topic)
        if publisher is not None:
            publisher.publish(cdr)

"""The wire: publishers and subscriptions that carry the bytes of a twin as they are."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, cast

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import MessageInfo, Subscription

from ldcs_ros.messages.topics import Topic
from ldcs_ros.ros.common.optional import import_problem, message_type
from ldcs_ros.ros.common.qos import OPTIONS, profile, with_profile

if TYPE_CHECKING:
    from rclpy.type_support import Msg

# An executor checks all its work between two messages; a flood is taken in batches, so that other work goes on.
_BATCH_SIZE = 100
_PUBLISHERS = 256


def subscribe_raw(
    node: Node,
    kind: str,
    topic: str,
    callback: Callable[[bytes, MessageInfo], None],
    qos: QoSProfile,
    options: QoSOverridingOptions | None = None,
) -> Subscription[Msg]:
    """Return a subscription that hands over each message as its bytes, with the middleware's information.

    Args:
        node: The node that subscribes.
        kind: Message type, such as 'std_msgs/msg/Header'.
        topic: Name of the topic.
        callback: Receiver of the messages.
        qos: Quality of service.
        options: Policies that parameters may override; None for none.
    """
    # The types of rclpy do not know raw subscriptions.
    typed = cast("Callable[[Msg, MessageInfo], None]", callback)
    return node.create_subscription(
        message_type(kind), topic, typed, qos, qos_overriding_options=options, raw=True
    )


class DrainingSubscription:
    """The callback of a raw subscription.

    A full queue drops its oldest messages silently; gaps in the numbers of a publisher's messages count them.
    Middleware without such numbers leaves `missed` at zero.

    Args:
        receive: Receiver of the bytes of each message.

    Attributes:
        subscription: The subscription; None until it is made.
        missed: Number of messages overwritten in the queue.
    """

    def __init__(self, receive: Callable[[bytes], None]) -> None:
        self.subscription: Subscription[Msg] | None = None
        self.missed = 0
        self._receive = receive
        self._latest: OrderedDict[bytes, int] = OrderedDict()

    def __call__(self, cdr: bytes, info: MessageInfo) -> None:
        """Hand on a message, and those that wait in the queue."""
        self._take(cdr, info)
        subscription = self.subscription
        if subscription is None:
            return
        with subscription.handle:
            for _ in range(_BATCH_SIZE):
                raw = subscription.handle.take_message(subscription.msg_type, True)
                taken = cast("tuple[bytes, MessageInfo] | None", raw)
                if taken is None:
                    return
                self._take(*taken)

    def _take(self, cdr: bytes, info: MessageInfo) -> None:
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

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Publisher[Msg]] = {}
        self._subscriptions: list[Subscription[Msg]] = []
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
            qos = profile(topic)
            if topic.direction == "out":
                self._publishers[topic.name] = self._node.create_publisher(
                    message_type(topic.type), topic.name, qos, qos_overriding_options=OPTIONS
                )
            else:
                callback = DrainingSubscription(partial(receive, topic.name))
                callback.subscription = subscribe_raw(
                    self._node, topic.type, topic.name, callback, qos, OPTIONS
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
        """Number of commands overwritten in a full queue."""
        return sum(callback.missed for callback in self._callbacks)

    def has_subscribers(self, topic: str) -> bool:
        """Return whether a topic has subscribers."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        """Publish one message; commands that the twin emits are left to their senders."""
        publisher = self._publishers.get(topic)
        if publisher is not None:
            publisher.publish(cdr)

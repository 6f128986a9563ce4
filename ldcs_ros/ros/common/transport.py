"""The wire: publishers and subscriptions that carry the twin's bytes as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from ldcs_ros.messages.topics import Topic
from ldcs_ros.ros.common.intake import Intake
from ldcs_ros.ros.common.optional import message_type, obstacle
from ldcs_ros.ros.common.qos import OPTIONS, profile, with_profile


class Transport:
    """Carries messages between a twin and the graph; add it to the twin's sinks.

    Args:
        node: The node that owns publishers and subscriptions.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._publishers: dict[str, Publisher[Any]] = {}
        self._subscriptions: list[Subscription[Any]] = []
        self._intakes: list[Intake] = []
        self._opened: dict[str, Topic] = {}

    def open(self, topics: Iterable[Topic], receive: Callable[[str, bytes], None]) -> dict[str, Topic]:
        """Publish the outgoing topics; hand the bytes of incoming ones to `receive(topic, cdr)`.

        Topics whose message package cannot be used are left out; those that are open stay as they are.

        Returns:
            Those of the topics that are open, by name, each with the quality of service that it got.
        """
        asked = list(topics)
        for topic in asked:
            if topic.name in self._opened or obstacle(topic.type.split("/")[0]):
                continue
            kind, qos = message_type(topic.type), profile(topic)
            if topic.direction == "out":
                self._publishers[topic.name] = self._node.create_publisher(
                    kind, topic.name, qos, qos_overriding_options=OPTIONS
                )
            else:
                intake = Intake(partial(receive, topic.name))
                intake.subscription = self._node.create_subscription(
                    kind, topic.name, intake, qos, qos_overriding_options=OPTIONS, raw=True
                )
                self._intakes.append(intake)
                self._subscriptions.append(intake.subscription)
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
        self._intakes.clear()
        self._opened.clear()

    @property
    def missed(self) -> int:
        """Commands that were overwritten in a full queue before they could be taken."""
        return sum(intake.missed for intake in self._intakes)

    def has_subscribers(self, topic: str) -> bool:
        """Return whether a topic has subscribers."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        """Publish one message; commands that the twin emits are not ours to publish."""
        publisher = self._publishers.get(topic)
        if publisher is not None:
            publisher.publish(cdr)

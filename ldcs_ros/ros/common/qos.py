"""Quality of service: the topic table's, and its overrides by parameters `qos_overrides.<topic>.<entity>.<policy>`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from ldcs_ros.errors import LdcsError
from ldcs_ros.messages.topics import Topic
from ldcs_ros.ros.common.parameters import ParameterNode
from ldcs_ros.schema.fields import did_you_mean

PREFIX = "qos_overrides."
ENTITIES = {"out": "publisher", "in": "subscription"}
WORDS = {
    "history": ("keep_last", "keep_all"),
    "reliability": ("reliable", "best_effort"),
    "durability": ("volatile", "transient_local"),
}
LONGEST_QUEUE = 100_000
POLICIES = (*WORDS, "depth")
OPTIONS = QoSOverridingOptions(
    (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
)
"""Policies that rclpy lets parameters override, for every topic."""


def profile(topic: Topic) -> QoSProfile:
    """Return the quality of service of a topic in the table."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if topic.keep_all else HistoryPolicy.KEEP_LAST,
        depth=topic.depth,
        reliability=ReliabilityPolicy.RELIABLE if topic.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.transient_local else DurabilityPolicy.VOLATILE,
    )


def with_profile(topic: Topic, qos: QoSProfile) -> Topic:
    """Return a topic with the quality of service that it got."""
    return replace(
        topic,
        reliable=qos.reliability is ReliabilityPolicy.RELIABLE,
        transient_local=qos.durability is DurabilityPolicy.TRANSIENT_LOCAL,
        keep_all=qos.history is HistoryPolicy.KEEP_ALL,
        depth=qos.depth,
    )


def check_overrides(node: ParameterNode, topics: Iterable[Topic]) -> list[str]:
    """Return an error text for each override that names no topic of the node: one file may serve many nodes.

    Raises:
        LdcsError: An override of a topic of the node has an unknown policy or an invalid value.
    """
    entities = {node.resolve_topic_name(topic.name): ENTITIES[topic.direction] for topic in topics}
    unknown = []
    for name, value in node.given_parameters().items():
        if not name.startswith(PREFIX):
            continue
        topic, entity, policy = _parts(name)
        if topic not in entities:
            unknown.append(f"'{name}' names no topic of this node.{did_you_mean(topic, entities)}")
        elif entity != entities[topic]:
            raise LdcsError(f"'{name}': {topic} has a {entities[topic]} here, no {entity or 'such entity'}")
        elif policy not in POLICIES:
            raise LdcsError(f"'{name}' names no policy, expected one of {', '.join(POLICIES)}")
        elif policy in WORDS and value not in WORDS[policy]:
            raise LdcsError(f"'{name}' is {value!r}, expected one of {', '.join(WORDS[policy])}")
        elif policy == "depth" and not (type(value) is int and 1 <= value <= LONGEST_QUEUE):
            raise LdcsError(f"'{name}' is {value!r}, expected a whole number, 1 ... {LONGEST_QUEUE}")
    return unknown


def _parts(name: str) -> tuple[str, str, str]:
    topic, *rest = name.removeprefix(PREFIX).split(".")
    return (topic, rest[0], rest[1]) if len(rest) == 2 else (topic, "", ".".join(rest))

"""Checks of the ROS graph: one clock, and one node of a name."""

from __future__ import annotations

import os
import time

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ldcs_ros.errors import LdcsError
from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.messages.topics import TOPICS

CLOCK = TOPICS["/clock"].name
DISCOVERY_TIME = 3.5
"""Wall time in which the publishers that were there before are known [s], on a machine that is not overloaded: Fast DDS
announces a participant at once, and where that was missed again after 3 s."""
_MOST_OVERLOAD = 5.0
NAMELESS = "a node without a name"


def sim_time_error(*, use_sim_time: bool, publish_clock: bool) -> str:
    """Return why these two parameters do not go together; '' when they do.

    A twin that followed another clock would have to wait for it, and its stamps would not be its simulation time.
    With `publish_clock` it is the clock that `use_sim_time` means: launch files set that for all nodes.
    """
    if use_sim_time and not publish_clock:
        return (
            "use_sim_time is true, but the twin keeps its own time and follows no clock: set publish_clock to true "
            "to make it the clock of the graph, or use_sim_time to false for this node"
        )
    return ""


class ClockMonitor:
    """Looks for other publishers of /clock: two clocks make time jump to and fro for every node that follows them.

    Args:
        node: The node whose graph is watched.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._since = time.monotonic()
        self._reported = False

    def refuse_second(self) -> None:
        """Wait until the graph is known, before the own clock is published.

        Raises:
            LdcsError: Another node publishes a clock.
        """
        # The others need the processor to answer.
        overload = os.getloadavg()[0] / (os.cpu_count() or 1)
        patience = DISCOVERY_TIME * min(max(1.0, overload), _MOST_OVERLOAD)
        while True:
            others = self._publishers()
            # A publisher is often found a moment before the name of its node.
            known = others and NAMELESS not in others
            if known or time.monotonic() > self._since + patience:
                break
            time.sleep(0.02)
        if others:
            raise LdcsError(
                f"{CLOCK} is published already, by {', '.join(others)}; a graph has one clock: "
                "set publish_clock to false, or end the other"
            )

    def status(self) -> Status:
        """Return the state of the own clock as an entry of the diagnostics; a second clock is also logged, once."""
        others = self._publishers()
        own = self._node.get_fully_qualified_name()
        if own in others:
            others.remove(own)
        trouble = ""
        if others:
            trouble = f"a second clock: {CLOCK} is published by {', '.join(others)} too; end it"
        if trouble and not self._reported:
            self._node.get_logger().error(trouble)
        self._reported = bool(trouble)
        return Status("clock", ERROR if trouble else OK, trouble or "the clock of this graph", {})

    def _publishers(self) -> list[str]:
        infos = self._node.get_publishers_info_by_topic(CLOCK)
        return [_name(one) for one in infos]


def _name(info: TopicEndpointInfo) -> str:
    # rmw's word for a node that it does not know, or not yet.
    if "_UNKNOWN_" in info.node_name:
        return NAMELESS
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


class DuplicateNodeCheck:
    """Looks for other nodes of the same full name.

    They are reported, not refused: a killed node stays in the graph for twenty seconds more, and the one started in its
    place has to run.

    Args:
        node: The node whose name is watched.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._reported = False

    def status(self) -> Status:
        """Return the state as an entry of the diagnostics; a duplicate is also logged, once."""
        own = self._node.get_fully_qualified_name()
        names = self._node.get_node_names_and_namespaces()
        count = sum(f"{namespace.rstrip('/')}/{name}" == own for name, namespace in names)
        trouble = ""
        if count > 1:
            trouble = (
                f"{count} nodes are named {own}: commands reach all of them, services any; end the others, or start "
                "them in namespaces of their own (--ros-args -r __ns:=/second); one that was killed fades in 20 s"
            )
        if trouble and not self._reported:
            self._node.get_logger().warning(trouble)
        self._reported = bool(trouble)
        return Status(
            "name", WARN if trouble else OK, trouble or "the only one", {"nodes of this name": count}
        )

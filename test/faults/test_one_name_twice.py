"""Two nodes of one name are reported, in the log and in the diagnostics."""

from __future__ import annotations

import time

import rclpy
from live import own_domain
from rclpy.context import Context
from rclpy.node import Node

from ldcs_ros.ros.sim.graph_checks import DuplicateNodeCheck


def until_level(namesakes, level):
    end = time.monotonic() + 10.0
    while (status := namesakes.status()).level != level and time.monotonic() < end:
        time.sleep(0.05)
    return status


def test_a_second_node_of_the_same_name_is_told_once_and_until_it_leaves(monkeypatch):
    context = Context()
    rclpy.init(context=context, domain_id=own_domain())
    try:
        first = Node("ldcs_sim", namespace="/ldcs", context=context)
        other = Node("ldcs_sim", namespace="/elsewhere", context=context)
        warned = []
        monkeypatch.setattr(first.get_logger(), "warning", warned.append)
        namesakes = DuplicateNodeCheck(first)
        assert until_level(namesakes, 0).message == "the only one"
        second = Node("ldcs_sim", namespace="/ldcs", context=context)
        status = until_level(namesakes, 1)
        assert "2 nodes are named /ldcs/ldcs_sim" in status.message and "__ns:=" in status.message
        namesakes.status()
        assert warned == [status.message]
        second.destroy_node()
        assert until_level(namesakes, 0).values == {"nodes of this name": 1}
        other.destroy_node()
        first.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)

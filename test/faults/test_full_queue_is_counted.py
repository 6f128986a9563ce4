"""Commands that a full queue dropped are counted, by the numbers that their publishers gave them."""

from __future__ import annotations

import pytest
import rclpy
from live import own_domain
from load_session import KEEP_ALL
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.ros.common.transport import DrainingSubscription

pytestmark = pytest.mark.timed


def test_what_was_taken_and_what_was_missed_is_what_was_sent():
    context = Context()
    rclpy.init(context=context, domain_id=own_domain())
    try:
        node = Node("reader", context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        taken: list[bytes] = []
        callback = DrainingSubscription(taken.append)
        callback.subscription = node.create_subscription(Float64MultiArray, "x", callback, 5, raw=True)
        senders = [node.create_publisher(Float64MultiArray, "x", KEEP_ALL) for _ in range(2)]
        while any(sender.get_subscription_count() == 0 for sender in senders):
            executor.spin_once(timeout_sec=0.02)

        def send(count):
            for sender in senders:
                for k in range(count):
                    sender.publish(pressure_command([float(k)]))

        def take():
            for _ in range(20):
                executor.spin_once(timeout_sec=0.02)

        send(1)  # who is heard for the first time has missed nothing yet
        take()
        assert (len(taken), callback.missed) == (2, 0)
        send(20)
        send(1)
        take()
        assert len(taken) + callback.missed == 2 * 22
        assert callback.missed >= 2 * 22 - 2 - 5 - 2
        executor.shutdown()
        node.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)

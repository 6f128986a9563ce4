"""`python -m ldcs_ros.ros.rig.topic_output`: the output process of a rig on ROS topics; the bridge starts it."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.device import Device
from ldcs_ros.rig.output.process import Settings, serve
from ldcs_ros.rig.output.topics import TopicDevice
from ldcs_ros.rig.topic_link import Incoming, values_of
from ldcs_ros.rig.units import PressureUnit
from ldcs_ros.ros.common.optional import message_type

if TYPE_CHECKING:
    from rclpy.type_support import Msg

NAMESPACE = "/ldcs"
SPINNING = "output graph"
_LONGEST_END = 1.0


def topic_device(kind: str, settings: Settings, limits: Limits, clock: Callable[[], float]) -> Device:
    """Return a device that publishes set-points through a node of its own and listens to what the rig reports."""
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    # The standby process has a node of its own beside this one.
    node = rclpy.create_node(
        f"ldcs_output_{os.getpid()}", namespace=NAMESPACE, start_parameter_services=False
    )
    send, unit = settings["send"], PressureUnit(**settings["send"]["unit"])
    publisher = node.create_publisher(Float64MultiArray, send["topic"], 10)
    rules = [Incoming(**{**rule, "unit": PressureUnit(**rule["unit"])}) for rule in settings["receive"]]
    rules = [rule for rule in rules if rule.gives != "position"]
    device = TopicDevice(
        lambda values: publisher.publish(Float64MultiArray(data=values)),
        unit,
        clock,
        rate=settings["rate"],
        reads_back=any(rule.gives == "pressure_command" for rule in rules),
    )
    # A best-effort subscription receives from reliable and best-effort publishers.
    listening = QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.BEST_EFFORT
    )
    for rule in rules:
        node.create_subscription(message_type(rule.type), rule.topic, partial(_hear, device, rule), listening)
    threading.Thread(target=_spin, args=(node,), name=SPINNING, daemon=True).start()
    return device


def _hear(device: TopicDevice, rule: Incoming, message: Msg) -> None:
    try:
        values = [(name, float(value)) for name, value in values_of(rule, message)]
    except Exception:  # a foreign message fails in as many ways as there are messages
        device.malformed += 1
        return
    for name, value in values:
        device.report(rule.gives, name, value)


def _spin(node: Node) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with contextlib.suppress(ExternalShutdownException):
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.1)


def main() -> NoReturn:
    """Run the output process and end it with its exit status."""
    status = serve(topic_device)
    rclpy.try_shutdown()
    # A thread inside ROS would abort the interpreter's end, and the exit status would be lost.
    for thread in threading.enumerate():
        if thread.name == SPINNING:
            thread.join(_LONGEST_END)
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    main()

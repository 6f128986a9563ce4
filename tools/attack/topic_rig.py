"""A hostile rig on ROS topics: pressures and read-back as a controller publishes them, and their abuse."""

from __future__ import annotations

import math
import random
import threading
import time
from typing import Any

import rclpy
from chambers import Chambers
from geometry_msgs.msg import TransformStamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Float64MultiArray

FAULTS = (
    "silent",
    "wrong sizes",
    "not a number",
    "stale stamps",
    "no read-back",
    "another publisher",
    "ignores",
    "above limit",
    "other read-back",
    "random bytes",
)
COMMAND, SETPOINT, TRACKER = "/rig/pressure_command", "/rig/pressure_setpoint", "/rig/trakstar_msg"
_PERIOD = 0.01


class TopicRig:
    """Publishes both pressures [Pa] and its set-points [Pa] at 100 Hz, and takes set-points [Pa].

    Args:
        domain: ROS domain.

    Attributes:
        chambers: The chambers.
        fault: Present fault; '' for none.
        tracks: A tracker reports both points, with leaps of centimetres.
        away: It is unplugged.
        drift: The reports lag by this many seconds per second from `drift_from`.
    """

    def __init__(self, domain: int) -> None:
        self.chambers = Chambers()
        self.fault, self.away, self.tracks = "", False, False
        self._random = random.Random(5)
        self.drift, self.drift_from = 0.0, 0.0
        self._domain = domain
        self._ending = threading.Event()
        self._frozen: Any = None
        self.listen()

    def link(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        pressure = {"type": "sensor_msgs/msg/FluidPressure", "gives": "pressure"}
        receive: list[dict[str, Any]] = [
            {"topic": f"/rig/{arm}/pressure", "names": [arm], **pressure} for arm in ("left", "right")
        ]
        array = {"type": "std_msgs/msg/Float64MultiArray", "gives": "pressure_command"}
        receive.append({"topic": SETPOINT, "names": ["left", "right"], **array})
        transform = {"type": "geometry_msgs/msg/TransformStamped", "gives": "position"}
        receive.append({"topic": TRACKER, "names": {"s0": "P0", "s1": "P1"}, **transform})
        return {"type": "topics", "receive": receive, "send": {"topic": COMMAND}}

    def break_answers(self, fault: str, count: int | None = None) -> None:
        """Misbehave in one way until `heal`."""
        assert fault in FAULTS, fault
        self._frozen = self._node.get_clock().now().to_msg()
        self.fault = fault

    def heal(self) -> None:
        """Work as it should."""
        self.fault, self.drift = "", 0.0

    def listen(self) -> None:
        """Join the graph."""
        self.away = False
        self._context = Context()
        rclpy.init(context=self._context, domain_id=self._domain)
        self._node = Node("hostile_rig", context=self._context)
        self._pressures = [
            self._node.create_publisher(FluidPressure, f"/rig/{arm}/pressure", 10)
            for arm in ("left", "right")
        ]
        self._setpoints = self._node.create_publisher(Float64MultiArray, SETPOINT, 10)
        self._intruder = self._node.create_publisher(Float64MultiArray, COMMAND, 10)
        self._tracker = self._node.create_publisher(TransformStamped, TRACKER, 10)
        self._node.create_subscription(Float64MultiArray, COMMAND, self._take, 10)
        self._node.create_timer(_PERIOD, self._report)
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def refuse(self) -> None:
        """Leave the graph, as a rig that dies."""
        self.away = True
        self._leaving.set()
        self._thread.join(3.0)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def close(self) -> None:
        """End it."""
        if not self._leaving.is_set():
            self.refuse()

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        while not self._leaving.is_set():
            executor.spin_once(timeout_sec=0.02)
        executor.shutdown()

    def _take(self, message: Float64MultiArray) -> None:
        if len(message.data) == 2 and all(math.isfinite(value) for value in message.data):
            left, right = (value * 1e-2 for value in message.data)
            self.chambers.ask(left, right, obey=self.fault != "ignores")

    def _report(self) -> None:
        fault = self.fault
        if fault == "another publisher":
            self._intruder.publish(Float64MultiArray(data=[95e3, 95e3]))
        if fault == "silent":
            return
        if self.tracks:
            self._track()
        now = time.monotonic()
        age = self.drift * (now - self.drift_from) if self.drift else 0.0
        pressures = list(self.chambers.pressure(now - age))
        if fault == "above limit":
            pressures[0] = 1950.0
        elif fault == "not a number":
            pressures = [math.nan, math.inf]
        stamp = self._node.get_clock().now()
        stamp = (stamp - rclpy.duration.Duration(seconds=age)).to_msg() if age else stamp.to_msg()
        if fault == "stale stamps":
            stamp = self._frozen
        for publisher, value in zip(self._pressures, pressures, strict=True):
            message = FluidPressure()
            message.header.stamp = stamp
            message.fluid_pressure = value * 100.0
            if fault == "random bytes":
                publisher.publish(bytes([0, 1, 0, 0]) + bytes(3))
            else:
                publisher.publish(message)
        if fault == "no read-back":
            return
        held = [
            value * 100.0 + (30e3 if fault == "other read-back" else 0.0)
            for value in self.chambers.setpoint()
        ]
        self._setpoints.publish(Float64MultiArray(data=held[:1] if fault == "wrong sizes" else held))

    def _track(self) -> None:
        leap = self._random.choice((0.0, 0.0, 0.03))
        for index, x in enumerate((0.07, 0.14)):
            message = TransformStamped()
            message.header.stamp = self._node.get_clock().now().to_msg()
            message.child_frame_id = f"s{index}"
            message.transform.translation.x = x
            message.transform.translation.z = self._random.gauss(0.0, 1e-4) + leap
            self._tracker.publish(message)

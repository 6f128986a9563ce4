"""An operator of the bridge: commands at 50 Hz, arm and disarm, and all reports of the graph."""

from __future__ import annotations

import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

BRIDGE = "/ldcs/ldcs_bridge"
COMMAND_PERIOD = 0.02
WARN = 30


class Operator:
    """A ROS user with a thread of its own.

    Args:
        domain: ROS domain.

    Attributes:
        pressure: Command that it repeats [Pa], one value an arm; None for silence.
        heard: Lines of `/rosout` and of `/diagnostics` at WARN and above: time, text.
    """

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = Node("operator", context=self._context)
        self.pressure: list[float] | None = None
        self.heard: list[tuple[float, str]] = []
        self._level = b"\x01"
        self._commands = self._node.create_publisher(Float64MultiArray, "/ldcs/pressure_command", 10)
        self._arm = self._node.create_client(Trigger, f"{BRIDGE}/arm")
        self._disarm = self._node.create_client(Trigger, f"{BRIDGE}/disarm")
        self._node.create_subscription(Log, "/rosout", self._log, 100)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, 10)
        self._node.create_timer(COMMAND_PERIOD, self._command)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the graph."""
        self._ending.set()
        self._thread.join(3.0)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def publish(self, values: list[float], times: int = 1) -> None:
        """Send a command [Pa] at once, beside the one that is repeated."""
        for _ in range(times):
            self._commands.publish(Float64MultiArray(data=values))

    def arm(self, timeout: float = 5.0) -> tuple[bool, str]:
        """Call arm; return success and message."""
        return self._call(self._arm, timeout)

    def disarm(self, timeout: float = 5.0) -> tuple[bool, str]:
        """Call disarm; return success and message."""
        return self._call(self._disarm, timeout)

    def _call(self, client: object, timeout: float) -> tuple[bool, str]:
        if not client.wait_for_service(timeout_sec=timeout):
            return False, "no such service"
        future = client.call_async(Trigger.Request())
        end = time.monotonic() + timeout
        while not future.done() and time.monotonic() < end:
            time.sleep(0.005)
        if not future.done():
            return False, "no answer"
        answer = future.result()
        return answer.success, answer.message

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        while not self._ending.is_set():
            executor.spin_once(timeout_sec=0.02)
        executor.shutdown()

    def _command(self) -> None:
        pressure = self.pressure
        if pressure is not None:
            self._commands.publish(Float64MultiArray(data=pressure))

    def _log(self, message: Log) -> None:
        if message.level >= WARN and message.name != "hostile_rig":
            self.heard.append((time.monotonic(), f"rosout: {message.msg}"))

    def _diagnose(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            if status.level >= self._level:
                self.heard.append((now, f"diagnostics: {status.name.rpartition(': ')[2]}: {status.message}"))

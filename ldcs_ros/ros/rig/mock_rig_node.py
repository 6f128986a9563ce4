"""The mock rig as a node: parameters and topics around a MockRigServer; faults are parameters that may change."""

from __future__ import annotations

import math
import sys
import threading
import time
from typing import TYPE_CHECKING

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import MessageInfo
from std_msgs.msg import Float64MultiArray

from ldcs_ros import load_scene
from ldcs_ros.errors import BridgeError, user_path
from ldcs_ros.mock_rig.modbus_server import ModbusServer
from ldcs_ros.mock_rig.rig import Hidden, MockRig, hidden_scene
from ldcs_ros.mock_rig.serial_port import SerialPort
from ldcs_ros.mock_rig.server import MockRigServer, Transport
from ldcs_ros.mock_rig.topics import ARRAY, Topics
from ldcs_ros.ros.common.optional import message_type
from ldcs_ros.ros.common.parameters import ParameterNode
from ldcs_ros.ros.common.transport import subscribe_raw
from ldcs_ros.ros.rig.rig_parameters import MOCK_RIG_PARAMETERS, TRANSPORTS

if TYPE_CHECKING:
    from rclpy.parameter import AllowableParameterValue, Parameter
    from rclpy.type_support import Msg

NODE_NAME = "mock_rig"
FAULT = "fault_"
STATUS_PERIOD = 2.0
GAUGE_PERIOD = 0.02
REST = 1.0


class MockRigNode(ParameterNode):
    """A mock rig; its own controller begins with the first subscriber, and `~/chambers` shows the true pressures.

    That topic carries, in Pa gauge: each arm's chamber, the largest pressure so far, the smallest and the largest
    set-point asked for.

    Attributes:
        finished: Set when the rig has failed; else it runs until it is stopped.
        failure: Reason of the failure; '' otherwise.

    Raises:
        LdcsError: A parameter does not fit; nothing was started.
    """

    def __init__(self) -> None:
        super().__init__(NODE_NAME, start_parameter_services=False)
        self.declare_table(MOCK_RIG_PARAMETERS)
        self.finished = threading.Event()
        self.failure = ""
        self._publishers_by_topic: dict[str, Publisher[Msg]] = {}
        self._rig = self._make_rig()
        self._server = MockRigServer(self._rig, self._make_transports())
        self._set_faults([self.get_parameter(name) for name in MOCK_RIG_PARAMETERS if name.startswith(FAULT)])
        self.add_on_set_parameters_callback(self._set_faults)
        # A subscriber of the first moment sees the rig at rest: a run that can be repeated.
        self._rig.course_start = math.inf
        self._server.start()
        self._write_rig_file()
        # The true pressures, whatever the rig's own reports say, for people and tests.
        self._gauge = self.create_publisher(Float64MultiArray, "~/chambers", 10)
        # A rig does not wait for a clock of the graph, whatever use_sim_time says.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers_kept = [
            self.create_timer(STATUS_PERIOD, self._report, clock=steady),
            self.create_timer(GAUGE_PERIOD, self._show_gauge, clock=steady),
            self.create_timer(GAUGE_PERIOD, self._begin_when_watched, clock=steady),
        ]

    def stop(self) -> None:
        """End the rig."""
        self._server.stop()

    def _make_rig(self) -> MockRig:
        hidden = Hidden(
            self.value("stiffness_factor"),
            self.value("gain_factor"),
            self.value("load"),
            self.value("tracker_delay"),
        )
        scene = hidden_scene(load_scene(self.value("scene")), hidden)
        controller, epoch = self.value("controller"), self.value("clock_epoch")
        return MockRig(scene, controller=controller, clock=time.monotonic, epoch=epoch)

    def _make_transports(self) -> list[Transport]:
        transport = self.value("transport")
        if transport not in TRANSPORTS:
            raise BridgeError(f"unknown transport {transport!r}; expected one of {list(TRANSPORTS)}")
        # The root namespace is '/'.
        namespace = self.get_namespace().rstrip("/")
        topics = Topics(self._rig, self._publish, pressures=transport == "topics", namespace=namespace)
        self._tracker_topic = topics.tracker
        for topic, kind in topics.outgoing().items():
            self._publishers_by_topic[topic] = self.create_publisher(message_type(kind), topic, 50)
        if transport == "topics":

            def receive(cdr: bytes, info: MessageInfo) -> None:
                topics.receive(cdr)

            subscribe_raw(self, ARRAY, topics.command, receive, QoSProfile(depth=10))
            return [topics]
        if transport == "modbus":
            return [ModbusServer(self._rig, self.value("port")), topics]
        return [SerialPort(self._rig), topics]

    def _publish(self, topic: str, message_type: str, cdr: bytes) -> None:
        self._publishers_by_topic[topic].publish(cdr)

    def _write_rig_file(self) -> None:
        text = self._server.rig_file({})
        path = self.value("rig_file")
        if path:
            # Written whole or not at all: a bridge may be waiting for it.
            file = user_path(path)
            draft = file.with_name(f"{file.name}.draft")
            draft.parent.mkdir(parents=True, exist_ok=True)
            draft.write_text(text, encoding="utf-8")
            draft.replace(file)
            self.get_logger().info(f"a bridge connects with rig:={path}")
        else:
            self.get_logger().info(
                f"a bridge connects with this rig file (-p rig_file:=PATH writes it):\n{text}"
            )

    def _set_faults(self, changes: list[Parameter[AllowableParameterValue]]) -> SetParametersResult:
        for change in changes:
            if not change.name.startswith(FAULT):
                continue
            try:
                self._rig.set_fault(change.name.removeprefix(FAULT), change.value)
            except BridgeError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _begin_when_watched(self) -> None:
        watched = self._publishers_by_topic[self._tracker_topic].get_subscription_count() > 0
        if watched and math.isinf(self._rig.course_start):
            self._rig.course_start = time.monotonic() + REST

    def _show_gauge(self) -> None:
        rig = self._rig
        asked = [rig.lowest_setpoint, rig.highest_setpoint]
        self._gauge.publish(Float64MultiArray(data=[*rig.pressure.tolist(), rig.peak, *asked]))

    def _report(self) -> None:
        if self._server.failure:
            self.failure = f"the rig stopped: {self._server.failure}"
            self.get_logger().error(self.failure)
            self.finished.set()
        rig = self._rig
        chambers = ", ".join(
            f"{arm} {value / 1e3:6.1f} kPa"
            for arm, value in zip(rig.simulation.arm_names, rig.pressure.tolist(), strict=True)
        )
        print(f"rig: {chambers}, peak {rig.peak / 1e3:6.1f} kPa", file=sys.stderr, flush=True)

"""The bridge as a node: parameters, topics, services and recorders around a Bridge; no decision of its own."""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from functools import partial

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import MessageInfo
from std_srvs.srv import Trigger

from ldcs_ros import load_scene
from ldcs_ros.errors import BridgeError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.diagnostics import ERROR, OK, Status
from ldcs_ros.messages.topics import Topic
from ldcs_ros.rig.bridge import Bridge, mode_of
from ldcs_ros.rig.gate import GateState
from ldcs_ros.rig.health import Health, headline
from ldcs_ros.rig.output.process import print_line
from ldcs_ros.rig.rig_bag import RigBag
from ldcs_ros.rig.rig_file import RigFile, load_rig
from ldcs_ros.rig.topic_link import TopicLink
from ldcs_ros.rig.vent import vent_rig
from ldcs_ros.ros.common.log import ThrottledLog
from ldcs_ros.ros.common.parameters import ParameterNode
from ldcs_ros.ros.common.qos import check_overrides
from ldcs_ros.ros.common.transport import TopicTransport, subscribe_raw
from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS
from ldcs_ros.ros.sim.runner import PeriodicTask
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings

NODE_NAME = "ldcs_bridge"
DEFAULT_NAMESPACE = "/ldcs"
PERIOD = 0.01
DIAGNOSTICS_PERIOD = 1.0
STATUS_PERIOD = 2.0
ARRAY = "std_msgs/msg/Float64MultiArray"
VENT = "vent"
_LONGEST_PASS = 1.0  # s: a pass of the loop that takes longer is not waited for at the end


class RigBridge(ParameterNode):
    """A bridge on a thread of its own.

    Attributes:
        finished: Set when the duration is over, or the bridge has failed.
        failure: Reason of the failure; '' otherwise.

    Raises:
        LdcsError: A parameter does not fit; nothing was started.
    """

    def __init__(self) -> None:
        super().__init__(NODE_NAME, namespace=DEFAULT_NAMESPACE, start_parameter_services=False)
        self.declare_table(BRIDGE_PARAMETERS)
        self.finished = threading.Event()
        self._stopping = threading.Event()
        self.failure = ""
        self._lock = threading.Lock()
        self._commands: deque[tuple[float, bytes]] = deque(maxlen=100)
        if not self.value("rig"):
            raise BridgeError("got no rig, expected its file: --ros-args -p rig:=my_rig.yaml")
        rig = load_rig(self.value("rig"))
        if self.value("mode") == VENT:
            self._vent(rig)
            return
        self._bridge = Bridge(
            load_scene(self.value("scene")),
            rig,
            mode=mode_of(self.value("mode")),
            clock=time.monotonic,
            settings=RunSettings(publish_rate=self.value("publish_rate"), accuracy=self.value("accuracy")),
        )
        self._health = Health(self._bridge)
        self._transport = TopicTransport(self)
        for unknown in check_overrides(self, self._published()):
            self.get_logger().warning(unknown)
        self._recorder: Recorder | None = None
        self._record()
        self._join_graph()
        self._log = ThrottledLog(self.get_logger(), time.monotonic)
        self._thread = threading.Thread(target=self._run, name="bridge", daemon=True)
        self._bridge.start()
        self._thread.start()

    def stop(self) -> None:
        """Vent if armed, end the thread, close the bags; may be called again."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        # The output process vents on its own when this thread hangs.
        self._thread.join(_LONGEST_PASS)
        self._bridge.stop()
        if self._bridge.unvented:
            self.failure = f"{self._bridge.unvented}; cut the supply"
        if self._recorder is not None:
            self._recorder.close()
        self._transport.close()

    def _vent(self, rig: RigFile) -> None:
        """Vent the rig and finish: the mode that needs no twin and no arming."""
        self._stopping.set()
        left = vent_rig(rig, show=print_line)
        if left:
            self.failure = f"{left}; cut the supply"
            self.get_logger().error(self.failure)
        else:
            self.get_logger().info("vented: the rig confirmed a set-point of zero")
        self.finished.set()

    def _record(self) -> None:
        folder = self.value("record")
        if not folder:
            return
        twin = self._bridge.twin
        self._recorder = Recorder(f"{folder}/twin", twin, namespace=self.get_namespace())
        twin.sinks.append(self._recorder)
        self._bridge.bag = RigBag(
            f"{folder}/rig",
            namespace=self.get_namespace(),
            arms=twin.simulation.arm_names,
            custom_data={
                "rig": self._bridge.rig.text,
                "scene": twin.scene.text,
                "mode": self._bridge.mode.value,
                "settled": "true",
            },
        )
        self.get_logger().info(f"recording to {folder}/twin and {folder}/rig")

    def _published(self) -> list[Topic]:
        return [topic for topic in self._bridge.twin.topics.values() if topic.direction == "out"]

    def _join_graph(self) -> None:
        self._transport.open(self._published(), lambda topic, cdr: None)
        self._bridge.twin.sinks.append(self._transport)
        subscribe_raw(self, ARRAY, "pressure_command", self._hear, QoSProfile(depth=10))
        # A best-effort subscription receives from reliable and best-effort publishers.
        listening = QoSProfile(
            history=HistoryPolicy.KEEP_LAST, depth=100, reliability=ReliabilityPolicy.BEST_EFFORT
        )
        for link in self._bridge.links:
            if not isinstance(link, TopicLink):
                continue
            for topic, rule in link.incoming.items():
                callback = partial(self._read, link, topic)
                subscribe_raw(self, rule.type, topic, callback, listening)
        self.create_service(Trigger, "~/arm", self._arm)
        self.create_service(Trigger, "~/disarm", self._disarm)

    def _hear(self, cdr: bytes, info: MessageInfo) -> None:
        self._commands.append((_heard(info), cdr))

    def _read(self, link: TopicLink, topic: str, cdr: bytes, info: MessageInfo) -> None:
        link.receive(topic, cdr, _heard(info))

    def _arm(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            try:
                self._bridge.arm()
                self._commands.clear()
                response.success, response.message = True, "armed: commands go to the rig"
            except BridgeError as error:
                response.success, response.message = False, str(error)
        return response

    def _disarm(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._bridge.gate.disarm()
            state = self._bridge.gate.state
        response.success = state is GateState.VENTED
        response.message = (
            "venting; the diagnostics report the confirmed zero"
            if response.success
            else f"mode {self._bridge.mode.value} commands nothing"
        )
        return response

    def _run(self) -> None:
        try:
            self._repeat()
        except Exception as error:  # whatever it is: the operator reads it, and the node ends, which vents
            self.failure = f"the bridge stopped: {error!r}"
            self.get_logger().error(f"{self.failure}\n{traceback.format_exc()}")
            self.finished.set()

    def _repeat(self) -> None:
        duration = self.value("duration")
        periodic_tasks = [PeriodicTask(DIAGNOSTICS_PERIOD, self._diagnose)]
        periodic_tasks.append(PeriodicTask(STATUS_PERIOD, lambda: print_line(headline(self._bridge))))
        deadline = time.monotonic()
        while not self._stopping.is_set():
            with self._lock:
                self._forward()
                self._bridge.protect()
                self._announce()
                self._bridge.follow()
                for task in periodic_tasks:
                    task.run_if_due()
            if 0.0 < duration <= self._bridge.twin.time:
                self.finished.set()
                return
            now = time.monotonic()
            deadline = max(deadline + PERIOD, now - PERIOD)
            self._stopping.wait(max(0.0, deadline - now))

    def _forward(self) -> None:
        while self._commands:
            heard, cdr = self._commands.popleft()
            try:
                self._bridge.command(decode(ARRAY, cdr).data, heard)
            except BridgeError:
                pass  # counted by the gate, and logged with its reason
            except Exception as error:  # foreign bytes: the decoder fails in as many ways as there are bytes
                self._bridge.gate.count_refusal("malformed", f"not a Float64MultiArray ({error!r})")

    def _announce(self) -> None:
        """Log each trip, and each kind of refusal at most once in a while."""
        gate = self._bridge.gate
        self._log.trip(gate.reason, gate.trips)
        self._log.refusals(gate.refused, gate.last_refusal)
        self._log.alarm(self._bridge.alarm())

    def _diagnose(self) -> None:
        statuses = [*self._health.read(), self._recording()]
        self._bridge.twin.emit_diagnostics(self.get_fully_qualified_name(), statuses)

    def _recording(self) -> Status:
        recorder, bag = self._recorder, self._bridge.bag
        if recorder is None or bag is None:
            return Status("recorder", OK, "off", {"recording": False})
        problem = recorder.error or bag.error
        values = {"twin messages": recorder.count, "rig messages": bag.count}
        return Status("recorder", ERROR if problem else OK, problem or "recording", values)


def _heard(info: MessageInfo) -> float:
    """Return the arrival of a message as a steady time [s]: it waits in DDS while this process is starved."""
    waited = max(time.time_ns() - info["received_timestamp"], 0) * 1e-9
    return time.monotonic() - waited

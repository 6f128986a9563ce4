"""The control panel of a running twin: what it reports, and commands by the topics and services that anyone may use."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from geometry_msgs.msg import Vector3
from rcl_interfaces.srv import GetParameters
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from ldcs_ros.bags import BagWriter, TopicInfo
from ldcs_ros.errors import CommandError, LdcsError, RecordingError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.message_types import PointCloudMessage
from ldcs_ros.physics.effects.arms import Arms
from ldcs_ros.ros.common.optional import build_advice, import_problem
from ldcs_ros.ros.common.transport import subscribe_raw
from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.schema.units import STANDARD_ATMOSPHERE
from ldcs_ros.signals.tracks import cloud_nodes, cloud_positions

if TYPE_CHECKING:
    from diagnostic_msgs.msg import DiagnosticStatus
    from ldcs_msgs.srv import ApplyWrench
    from rclpy.client import Client
    from rclpy.subscription import MessageInfo

_PATIENCE = 5.0
"""Time in which a service must answer [s]."""
_LOOK_AGAIN = 0.05  # s
_TRIGGERS = ("pause", "resume", "step", "reset", "rearm")
_JOINTS, _POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
_FLUID, _CLOUD = "sensor_msgs/msg/FluidPressure", "sensor_msgs/msg/PointCloud2"
_ARRAY, _DIAGNOSTICS = "std_msgs/msg/Float64MultiArray", "diagnostic_msgs/msg/DiagnosticArray"
RequestT = TypeVar("RequestT")
ResponseT = TypeVar("ResponseT")
ResultT = TypeVar("ResultT")
_SHOWN = {
    "real-time factor": ("pace", "{:.2f} x real time"),
    "error_estimate [m]": ("estimated error", "{:.1e} m"),
}


class Panel:
    """A twin behind a page: implements `ControlledTwin`; its node is spun by the caller.

    The page's requests come on threads of their own. Whatever they do with the node waits for `work`, on the thread
    that spins it.

    Args:
        node: A node in the twin's namespace.
        folder: Folder in which recordings begin.
    """

    def __init__(self, node: Node, folder: Path) -> None:
        self._node = node
        self._folder = folder
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._lock = threading.Lock()
        self._waiting: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._latest: dict[str, bytes] = {}
        self._types: dict[str, str] = {}
        self._scene: Scene | None = None
        self._asked_for = ""
        self._ambient_pressure = STANDARD_ATMOSPHERE
        self._recorder: BagWriter | None = None
        self._pressure = node.create_publisher(Float64MultiArray, "pressure_command", 10)
        self._torque = node.create_publisher(JointState, "torque_command", 10)
        self._triggers: dict[str, Client[Trigger.Request, Trigger.Response]] = {
            name: node.create_client(Trigger, f"ldcs_sim/{name}") for name in _TRIGGERS
        }
        self._push_client: Client[ApplyWrench.Request, ApplyWrench.Response] | None = None
        self._parameters: Client[GetParameters.Request, GetParameters.Response] = node.create_client(
            GetParameters, "ldcs_sim/get_parameters"
        )

    def search(self) -> None:
        """Subscribe to new topics of the namespace, and ask once for the scene and the pressure of its air."""
        quality = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._types or not types or not topic.startswith((self._prefix, "/diagnostics")):
                continue
            # The feedback of an action has a type of its own kind, which is no message of the package.
            package, kind, _ = types[0].split("/")
            if kind != "msg" or import_problem(package):
                continue
            self._types = {**self._types, topic: types[0]}
            subscribe_raw(self._node, types[0], topic, partial(self._take, topic, types[0]), quality)
        said = _values(self._diagnostics(self._snapshot())).get("scene", "")
        if said and said != self._asked_for:
            self._asked_for = said
            threading.Thread(target=self._ask_for_the_scene, args=(said,), daemon=True).start()

    def work(self) -> None:
        """Do what requests wait for; on the thread that spins the node."""
        while not self._waiting.empty():
            self._waiting.get()()

    def close(self) -> None:
        """End a recording."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()

    def state(self) -> Mapping[str, object]:
        """Return what the page shows."""
        latest = self._snapshot()
        cloud = latest.get(self._prefix + "nodes")
        if cloud is None:
            return {"title": f"no twin sends in {self._node.get_namespace()} yet"}
        message: PointCloudMessage = decode(_CLOUD, cloud)
        position = cloud_positions(message)
        nodes = cloud_nodes(message)
        diagnostics = self._diagnostics(latest)
        said = _values(diagnostics)
        status: dict[str, str] = {
            name: form.format(float(said[key])) for key, (name, form) in _SHOWN.items() if key in said
        }
        status |= {key: said[key] for key in ("mode", "refused") if key in said}
        # The message of each entry that is not well.
        status |= {one.name.rpartition(": ")[2]: one.message for one in diagnostics if _level(one.level) > 0}
        recorder = self._recorder
        return {
            "title": said.get("scene", "a twin"),
            "time": message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec,
            "nodes": nodes,
            "length": self._length(position, nodes),
            "position": [row.round(6).tolist() if np.isfinite(row).all() else None for row in position],
            "points": self._points(latest),
            "arms": self._arms(latest),
            "status": status,
            "recording": None if recorder is None else str(recorder.folder),
        }

    def command(self, request: Mapping[str, object]) -> str:
        """Carry out a request of the page.

        Raises:
            LdcsError: It is refused, by the twin or before.
        """
        what = request.get("do")
        if what in _TRIGGERS:
            answer = self._answer(self._triggers[str(what)], Trigger.Request())
            if not answer.success:
                raise CommandError(f"{what}: {answer.message}")
            if what == "reset":  # the scene's schedule acts again
                with self._lock:
                    self._latest.pop(self._prefix + "pressure_command", None)
            return answer.message or f"{what}: done"
        if what == "drive":
            return self._drive({str(request.get("arm")): _number(request, "value")})
        if what == "zero":
            return self._drive(dict.fromkeys(self._names(self._snapshot()), 0.0))
        if what == "push":
            return self._push(request)
        if what == "record":
            return self._record(on=request.get("on") is True)
        raise CommandError(
            f"got the request {what!r}, expected one of {[*_TRIGGERS, 'drive', 'zero', 'push', 'record']}"
        )

    def _take(self, topic: str, kind: str, cdr: bytes, info: MessageInfo) -> None:
        with self._lock:
            self._latest[topic] = cdr
        recorder = self._recorder
        if recorder is not None:
            try:
                recorder.write(topic, kind, cdr, time.time_ns())
            except RecordingError as error:
                self._node.get_logger().warning(f"not recorded: {error}", once=True)

    def _drive(self, values: Mapping[str, float]) -> str:
        """Command gauge pressures [kPa] or joint torques [N m] of some arms; the others keep theirs."""
        latest = self._snapshot()
        names = self._names(latest)
        if unknown := sorted(set(values) - set(names)):
            raise CommandError(f"got the arm {unknown[0]!r}, expected one of {names}")
        pressure = self._drive_of_arms() == "pressure"
        for name, value in values.items():
            least, most = self._bounds(name)
            if not least <= value <= most:
                raise CommandError(
                    f"{name}: got {value:g}, expected {least:g} ... {most:g} {_unit(pressure)}"
                )
        commanded = {**self._held(latest), **values}
        held = [commanded[name] for name in names]
        if pressure:
            message = Float64MultiArray(data=[1e3 * value for value in held])
            self._on_node(lambda: self._pressure.publish(message))
            return ", ".join(f"{name} {value:.1f} kPa" for name, value in values.items())
        joints = self._joints(latest)
        command = JointState(name=joints, effort=[held[names.index(_arm_of(joint))] for joint in joints])
        self._on_node(lambda: self._torque.publish(command))
        return ", ".join(f"{name} {value:.4f} N m" for name, value in values.items())

    def _push(self, request: Mapping[str, object]) -> str:
        if problem := import_problem("ldcs_msgs"):
            raise CommandError(f"push: ldcs_msgs {problem}; {build_advice()}")
        from ldcs_msgs.srv import ApplyWrench

        force = request.get("force")
        if not isinstance(force, list) or len(force) != 3:
            raise CommandError(f"push: got the force {force!r}, expected three numbers [N]")
        x, y, z = (_number({"force": part}, "force") for part in force)
        asked = ApplyWrench.Request(point=str(request.get("point")), frame_id="ldcs_base")
        asked.wrench.force = Vector3(x=x, y=y, z=z)
        asked.duration = Duration(seconds=_number(request, "duration")).to_msg()
        if self._push_client is None:
            self._push_client = self._on_node(
                lambda: self._node.create_client(ApplyWrench, "ldcs_sim/apply_wrench")
            )
        answer = self._answer(self._push_client, asked)
        if not answer.success:
            raise CommandError(f"push: {answer.message}")
        return str(answer.message)

    def _record(self, *, on: bool) -> str:
        recorder = self._recorder
        if not on:
            self.close()
            return (
                "no recording" if recorder is None else f"{recorder.folder} holds {recorder.count} messages"
            )
        if recorder is not None:
            raise CommandError(f"already recording into {recorder.folder}")
        folder = self._folder / datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        folder.parent.mkdir(parents=True, exist_ok=True)
        self._recorder = BagWriter(
            folder, topics={name: TopicInfo(kind) for name, kind in self._types.items()}
        )
        return f"recording into {folder}"

    def _on_node(self, work: Callable[[], ResultT]) -> ResultT:
        """Do something with the node on the thread that spins it, and return what it returns."""
        result: Future[ResultT] = Future()

        def do() -> None:
            try:
                result.set_result(work())
            except Exception as error:
                result.set_exception(error)

        self._waiting.put(do)
        try:
            return result.result(_PATIENCE)
        except FutureTimeoutError as error:
            raise CommandError(f"the panel's node is busy for {_PATIENCE:g} s; try again") from error

    def _answer(self, client: Client[RequestT, ResponseT], request: RequestT) -> ResponseT:
        """Return the answer of a service; on the thread of a request."""
        end = time.monotonic() + _PATIENCE
        while not self._on_node(client.service_is_ready):
            if time.monotonic() > end:
                raise CommandError(f"no twin offers {client.srv_name}")
            time.sleep(_LOOK_AGAIN)
        done = threading.Event()
        future = self._on_node(lambda: client.call_async(request))
        future.add_done_callback(lambda _: done.set())
        answer = future.result() if done.wait(_PATIENCE) else None
        if answer is None:
            raise CommandError(f"{client.srv_name} did not answer within {_PATIENCE:g} s")
        return answer

    def _ask_for_the_scene(self, said: str) -> None:
        names = [said]
        try:
            answer = self._answer(
                self._parameters, GetParameters.Request(names=["scene", "ambient_pressure"])
            )
            names.insert(0, answer.values[0].string_value)
            self._ambient_pressure = answer.values[1].double_value
        except LdcsError:
            pass
        for name in names:
            try:
                self._scene = load_scene(name)
                return
            except (LdcsError, OSError):
                continue
        self._scene = None  # a scene of another machine: the arms' default limits serve

    def _arms(self, latest: Mapping[str, bytes]) -> list[dict[str, object]]:
        pressure = self._drive_of_arms() == "pressure"
        held = self._held(latest)
        arms = []
        for name in held:
            least, most = self._bounds(name)
            cdr = latest.get(f"{self._prefix}{name}/pressure")
            measured = None
            if cdr is not None:
                measured = 1e-3 * (decode(_FLUID, cdr).fluid_pressure - self._ambient_pressure)
            arms.append(
                {
                    "name": name,
                    "unit": _unit(pressure),
                    "digits": 1 if pressure else 4,
                    "least": least,
                    "most": most,
                    "commanded": held[name],
                    "measured": measured,
                }
            )
        return arms

    def _held(self, latest: Mapping[str, bytes]) -> dict[str, float]:
        """Return what each arm is commanded at present, by anyone: gauge pressure [kPa] or joint torque [N m]."""
        names = self._names(latest)
        sent, joints, cloud = (
            latest.get(self._prefix + name) for name in ("pressure_command", "joint_states", "nodes")
        )
        if self._drive_of_arms() != "pressure":
            message = None if joints is None else decode(_JOINTS, joints)
            torque = {} if message is None else dict(zip(message.name, message.effort, strict=True))
            return {
                name: next((float(v) for j, v in torque.items() if _arm_of(j) == name), 0.0) for name in names
            }
        asked: object = 0.0
        if sent is not None:
            data = np.asarray(decode(_ARRAY, sent).data, dtype=float)
            asked = data if data.size in (1, len(names)) else 0.0
        elif (scene := self._scene) is not None and cloud is not None:
            now = decode(_CLOUD, cloud).header.stamp
            due = [
                e for e in scene.inputs if e.pressure is not None and e.time <= now.sec + 1e-9 * now.nanosec
            ]
            asked = due[-1].pressure if due else 0.0
        values = np.broadcast_to(np.asarray(asked, dtype=float), len(names))
        return {name: 1e-3 * float(value) for name, value in zip(names, values, strict=True)}

    def _bounds(self, arm: str) -> tuple[float, float]:
        """Return least and largest command of an arm, in the units of `_held`."""
        if self._drive_of_arms() == "pressure":
            return 0.0, 1e-3 * self._limit(arm, "pressure_limit")
        limit = self._limit(arm, "torque_limit")
        return -limit, limit

    def _limit(self, arm: str, key: str) -> float:
        scene = self._scene
        arms = None if scene is None else scene.effect("arms")
        if scene is None or arms is None:
            return float(getattr(Arms, key))
        for one in arms.placed(scene.lattice):
            if one.name == arm and key in one.own:
                return float(one.own[key])
        return float(getattr(arms, key))

    def _drive_of_arms(self) -> str:
        scene = self._scene
        arms = None if scene is None else scene.effect("arms")
        if arms is not None:
            return str(arms.drive)
        measured = any(kind == _FLUID for kind in self._types.values())
        return "pressure" if measured else "torque"

    def _snapshot(self) -> dict[str, bytes]:
        """Return the latest message of each topic, all of one moment."""
        with self._lock:
            return dict(self._latest)

    def _joints(self, latest: Mapping[str, bytes]) -> list[str]:
        cdr = latest.get(self._prefix + "joint_states")
        return [] if cdr is None else list(decode(_JOINTS, cdr).name)

    def _names(self, latest: Mapping[str, bytes]) -> list[str]:
        return list(dict.fromkeys(_arm_of(joint) for joint in self._joints(latest)))

    def _points(self, latest: Mapping[str, bytes]) -> dict[str, list[float]]:
        found = {}
        for topic, cdr in sorted(latest.items()):
            parts = topic.removeprefix(self._prefix).split("/")
            if parts[0] == "truth" and parts[-1] == "pose":
                place = decode(_POSE, cdr).pose.position
                found[parts[1]] = [round(place.x, 6), round(place.y, 6), round(place.z, 6)]
        return found

    def _length(self, position: np.ndarray, nodes: tuple[int, int]) -> float:
        scene = self._scene
        if scene is not None:
            return float(scene.lattice.size[0])
        cells = np.linalg.norm(np.diff(position.reshape(2, *nodes, 3)[0], axis=0), axis=-1)
        return float(np.nanmean(cells) * (nodes[0] - 1))

    def _diagnostics(self, latest: Mapping[str, bytes]) -> list[DiagnosticStatus]:
        cdr = latest.get("/diagnostics")
        return [] if cdr is None else decode(_DIAGNOSTICS, cdr).status


def follow(panel: Panel, spin: Callable[[], None], stopped: Callable[[float], bool], period: float) -> None:
    """Keep a panel up to date until a stop signal."""
    searched = 0.0
    while not stopped(0.0):
        spin()
        panel.work()
        if time.monotonic() >= searched + period:
            searched = time.monotonic()
            panel.search()


def _values(diagnostics: Sequence[DiagnosticStatus]) -> dict[str, str]:
    return {pair.key: pair.value for status in diagnostics for pair in status.values}


def _level(level: bytes | int) -> int:
    return level[0] if isinstance(level, bytes) else level


def _unit(pressure: bool) -> str:
    return "kPa" if pressure else "N m"


def _arm_of(joint: str) -> str:
    return joint.rpartition("_joint_")[0]


def _number(request: Mapping[str, object], key: str) -> float:
    value = request.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise CommandError(f"{key}: got {value!r}, expected a number")
    return float(value)

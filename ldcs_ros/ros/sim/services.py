"""The node's own services: pause, resume, step, reset, rearm, apply_wrench, load_scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_srvs.srv import Trigger

from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.lattice import lattice_state
from ldcs_ros.ros.common.refusals import InvalidStateError, report_errors
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.ros.sim.scene_loader import SceneLoader

MAX_ADVANCE = 10 * 10**9
"""Longest advance of one call [ns of simulation time]."""


class Services:
    """Serves `~/pause`, `~/resume`, `~/step`, `~/reset` and `~/rearm`, all std_srvs/Trigger.

    `step` advances by exactly one publish period and works only while paused.

    Args:
        node: The node that offers them.
        runner: Returns the runner, or raises NotActive while the node is not active.
    """

    def __init__(self, node: LifecycleNode, runner: Callable[[], Runner]) -> None:
        self._node = node
        self._runner = runner
        actions: dict[str, Callable[[Runner], str]] = {
            "pause": _pause,
            "resume": _resume,
            "step": _step,
            "reset": _reset,
            "rearm": _rearm,
        }
        for name, action in actions.items():
            node.create_service(Trigger, f"~/{name}", self._handler(action))

    def _handler(
        self, action: Callable[[Runner], str]
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def handle(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with report_errors(self._node, response):
                runner = self._runner()
                response.message = runner.call(lambda: action(runner))
                response.success = True
            return response

        return handle


def _pause(runner: Runner) -> str:
    runner.pause()
    return f"{runner.mode.value} at t = {runner.twin.time:.9g} s"


def _resume(runner: Runner) -> str:
    runner.resume()
    return f"{runner.mode.value} from t = {runner.twin.time:.9g} s"


def _step(runner: Runner) -> str:
    return f"t = {runner.step():.9g} s"


def _reset(runner: Runner) -> str:
    runner.reset()
    return f"{runner.mode.value} at t = {runner.twin.time:.9g} s"


def _rearm(runner: Runner) -> str:
    return "commands are accepted again" if runner.twin.rearm() else "the watchdog had not tripped"


class WrenchService:
    """Serves `~/apply_wrench`, ldcs_msgs/ApplyWrench.

    Args:
        node: The node that offers it.
        service_type: The class ApplyWrench.
        runner: Returns the runner, or raises InvalidStateError while the node is not active.
    """

    def __init__(self, node: LifecycleNode, service_type: Any, runner: Callable[[], Runner]) -> None:
        self._node = node
        self._runner = runner
        node.create_service(service_type, "~/apply_wrench", self._handle)

    def _handle(self, request: Any, response: Any) -> Any:
        with report_errors(self._node, response):
            runner = self._runner()
            wrench = {
                "point": request.point,
                "frame_id": request.frame_id,
                "force": _components(request.wrench.force),
                "torque": _components(request.wrench.torque),
                "duration": _seconds(request.duration),
                "ramp": _seconds(request.ramp),
            }
            response.message = runner.call(lambda: runner.twin.apply_wrench(**wrench))
            response.success = True
        return response


def _components(vector: Any) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _seconds(duration: Any) -> float:
    return float(duration.sec) + float(duration.nanosec) * 1e-9


class AdvanceService:
    """Serves `~/advance`, ldcs_msgs/Advance: lock-step for closed loops.

    Args:
        node: The node that offers it.
        service_type: The class Advance.
        runner: Returns the runner, or raises InvalidStateError while the node is not active.
    """

    def __init__(self, node: LifecycleNode, service_type: Any, runner: Callable[[], Runner]) -> None:
        self._node = node
        self._runner = runner
        self._state_type = type(service_type.Response().state)
        # Others are served while this one waits for the end of the advance.
        node.create_service(service_type, "~/advance", self._handle, callback_group=ReentrantCallbackGroup())

    async def _handle(self, request: Any, response: Any) -> Any:
        with report_errors(self._node, response):
            runner = self._runner()
            duration = request.duration.sec * 10**9 + request.duration.nanosec
            if not 0 < duration <= MAX_ADVANCE:
                raise InvalidStateError(
                    f"got a duration of {duration / 1e9:.9g} s, expected above 0 and at most {MAX_ADVANCE / 1e9:g} s"
                )
            command = _arm_command(request.command) if request.command.arms else None

            def advance() -> tuple[float, bytes]:
                time, twin = runner.advance_by(duration, command), runner.twin
                simulation = twin.simulation
                return time, lattice_state(
                    nanoseconds(time),
                    twin.frames.base,
                    simulation.lattice,
                    simulation.arm_names,
                    simulation.state,
                )

            done: Future[Any] = Future(executor=self._node.executor)
            runner.submit(advance).add_done_callback(done.set_result)
            ended: Any = await done
            if ended.cancelled():
                raise InvalidStateError("the node was cleaned up before the end of the advance")
            time, state = ended.result()
            response.state = deserialize_message(state, self._state_type)
            response.success, response.message = True, f"t = {time:.9g} s"
        return response


def _arm_command(command: Any) -> bytes:
    # rclpy pads the end of what it serialises; the twin takes bytes as a subscription hands them over.
    stamp = command.header.stamp.sec * 10**9 + command.header.stamp.nanosec
    return encode(
        message_class("ldcs_msgs/msg/ArmCommand")(
            header=header(stamp, command.header.frame_id),
            sequence=command.sequence,
            arms=list(command.arms),
            pressures=np.array(command.pressures, dtype=np.float64),
            torques=np.array(command.torques, dtype=np.float64),
        )
    )


class SceneService:
    """Serves `~/load_scene`, ldcs_msgs/LoadScene.

    Args:
        node: The node that offers it.
        service_type: The class LoadScene.
        loader: What loads the scenes.
        files: Resolver of paths.
    """

    def __init__(
        self, node: LifecycleNode, service_type: Any, loader: SceneLoader, files: GraphFiles
    ) -> None:
        self._node = node
        self._loader = loader
        self._files = files
        # Others are served while this one waits for the new twin.
        node.create_service(
            service_type, "~/load_scene", self._handle, callback_group=ReentrantCallbackGroup()
        )

    async def _handle(self, request: Any, response: Any) -> Any:
        with report_errors(self._node, response):
            twin, trouble = await self._loader.load(partial(self._files.scene, request.scene))
            title = twin.scene.title or twin.scene.name
            response.success, response.message = True, f"{title}; {trouble}" if trouble else str(title)
            response.effects = list(twin.simulation.effects)
        return response

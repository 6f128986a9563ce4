"""The node's own services: pause, resume, step, reset, rearm, apply_wrench, load_scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from std_srvs.srv import Trigger

from ldcs_ros.ros.common.refusals import report_errors
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.ros.sim.scene_loader import SceneLoader


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
        runner: Returns the runner, or raises NotNow while the node is not active.
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

"""The node's services of standard types: pause, resume, step, reset, rearm."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.lifecycle import LifecycleNode
from std_srvs.srv import Trigger

from ldcs_ros.ros.common.refusals import report_errors
from ldcs_ros.ros.sim.runner import Runner


class Services:
    """Serves `~/pause`, `~/resume`, `~/step`, `~/reset` and `~/rearm`, all std_srvs/Trigger.

    `step` advances by exactly one publish period and works only while paused.

    Args:
        node: The node that offers them.
        runner: Returns the runner, or raises InactiveNodeError while the node is not active.
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

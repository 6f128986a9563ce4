"""The service `~/apply_wrench`: a wrench that acts for a while."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode

from ldcs_ros.ros.common.refusals import told
from ldcs_ros.ros.sim.runner import Runner


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
        with told(self._node, response):
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

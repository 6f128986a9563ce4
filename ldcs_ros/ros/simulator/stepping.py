"""StepSimulation and SimulateSteps: steps of one publish period each, one after the other, while time stands."""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent import futures
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import Result

from ldcs_ros.ros.sim.runner import Mode, NotNow
from ldcs_ros.ros.simulator.answers import Refused, offer, result_of
from ldcs_ros.ros.simulator.host import Host

# Steps follow each other in a millisecond or two: who looks every tenth of a second still hears of each.
_FEEDBACK_DEPTH = 100
_TURN = 0.02  # s, after which others have their turn while a step takes long


class Stepping:
    """Takes steps on the runner's thread, one request a step: whatever else is asked meanwhile is served in between.

    Args:
        node: The node that offers the service and the action.
        host: The same, as what has the runner.

    Attributes:
        offered: Names of the types that are offered.
    """

    def __init__(self, node: LifecycleNode, host: Host) -> None:
        self._node = node
        self._host = host
        self._busy = False
        group = ReentrantCallbackGroup()
        self.offered = ["StepSimulation"] if offer(node, "StepSimulation", self._serve, group=group) else []
        self.offered.append("SimulateSteps")
        self._server: ActionServer[Any, Any, Any] = ActionServer(
            node,
            SimulateSteps,
            "~/simulate_steps",
            self._execute,
            callback_group=group,
            feedback_pub_qos_profile=QoSProfile(depth=_FEEDBACK_DEPTH),
            cancel_callback=lambda request: CancelResponse.ACCEPT,
        )

    def close(self) -> None:
        """Withdraw the action."""
        self._server.destroy()

    async def _serve(self, request: Any, response: Any) -> None:
        await self._take(request.steps, lambda done: True)

    async def _execute(self, goal: ServerGoalHandle[Any, Any, Any]) -> Any:
        result, steps = SimulateSteps.Result(), goal.request.steps

        def tell(done: int) -> bool:
            feedback = SimulateSteps.Feedback(completed_steps=done, remaining_steps=steps - done)
            goal.publish_feedback(feedback)
            return not goal.is_cancel_requested

        try:
            taken = await self._take(steps, tell)
        except Exception as error:
            result.result = result_of(self._node, error)
            goal.abort()
            return result
        if taken < steps:
            reason = f"cancelled after {taken} of {steps} steps"
            result.result = Result(result=Result.RESULT_OPERATION_FAILED, error_message=reason)
            goal.canceled()
        else:
            result.result.result = Result.RESULT_OK
            goal.succeed()
        return result

    async def _take(self, steps: int, tell: Callable[[int], bool]) -> int:
        # Returns how many were taken: `tell`, which hears of each, may say that it is enough.
        if self._busy:
            raise NotNow("steps are being taken already; wait for their end, or cancel them")
        if (mode := self._host.active_runner().mode) is not Mode.PAUSED:
            raise NotNow(f"the simulation is {mode.value}; steps are taken while it is paused")
        self._busy, time = True, 0.0
        try:
            for taken in range(steps):
                try:
                    time = await self._step(time)
                except NotNow as error:
                    kind = type(error)
                    raise kind(f"{error}; {taken} of {steps} steps were taken") from error
                if not tell(taken + 1):
                    return taken + 1
            return steps
        finally:
            self._busy = False

    async def _step(self, behind: float) -> float:
        # Takes a step from a time on and returns the time behind it.
        runner = self._host.active_runner()
        if runner.twin.time < behind:
            raise NotNow("the simulation went back to a start")
        future = runner.hand_in(runner.step)
        waiting = True
        while waiting:
            waiting = bool(futures.wait([future], _TURN).not_done)
            await _Turn(self._node)
        if future.cancelled():
            raise Refused(
                Result.RESULT_INCORRECT_STATE, "the node was cleaned up before all steps were taken"
            )
        return future.result()


class _Turn:
    """Awaited, it lets the executor look at everything else once."""

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node

    def __await__(self) -> Generator[None, None, None]:
        # An executor that is not woken would wait for other work before it comes back.
        if self._node.executor is not None:
            self._node.executor.wake()
        yield

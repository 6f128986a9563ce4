"""State, reset and stepping of the simulation by the standard simulator services."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from concurrent import futures
from typing import TYPE_CHECKING, Protocol

from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import Result, SimulationState
from simulation_interfaces.srv import ResetSimulation, SetSimulationState

from ldcs_ros.ros.common.refusals import InvalidStateError
from ldcs_ros.ros.sim.runner import RunMode, Runner
from ldcs_ros.ros.simulator.answers import ResultError, offer_service, result_of

if TYPE_CHECKING:
    from simulation_interfaces.srv import GetSimulationState, StepSimulation

    Goal = ServerGoalHandle[SimulateSteps.Goal, SimulateSteps.Result, SimulateSteps.Feedback]


class Host(Protocol):
    """The node as the simulator services use it."""

    finished: threading.Event
    """Set to end the node."""

    @property
    def runner(self) -> Runner | None:
        """The runner; None while the node is unconfigured."""

    def active_runner(self) -> Runner:
        """Return the runner, or raise InactiveNodeError."""


# A simulation that cannot go on is paused: the interfaces have no state for it, and the message gives the reason.
_STATES = {
    RunMode.STOPPED: SimulationState.STATE_STOPPED,
    RunMode.RUNNING: SimulationState.STATE_PLAYING,
    RunMode.PAUSED: SimulationState.STATE_PAUSED,
    RunMode.FAILED: SimulationState.STATE_PAUSED,
    RunMode.FINISHED: SimulationState.STATE_QUITTING,
}
_WORDS = {
    SimulationState.STATE_STOPPED: "stopped",
    SimulationState.STATE_PLAYING: "playing",
    SimulationState.STATE_PAUSED: "paused",
    SimulationState.STATE_QUITTING: "quitting",
}
_WHOLE = ResetSimulation.Request.SCOPE_TIME | ResetSimulation.Request.SCOPE_STATE


class Control:
    """GetSimulationState, SetSimulationState and ResetSimulation.

    Args:
        host: The node.
    """

    def __init__(self, host: Host) -> None:
        self._host = host

    def report_state(
        self, request: GetSimulationState.Request, response: GetSimulationState.Response
    ) -> None:
        """Report the state, with the reason if the simulation cannot go on."""
        response.state.state = self._state()
        if self._host.runner is not None:
            response.result.error_message = self._host.runner.failure

    def change_state(
        self, request: SetSimulationState.Request, response: SetSimulationState.Response
    ) -> None:
        """Play, pause, stop (back to the start) or quit.

        Raises:
            ResultError: The state is none of these.
        """
        target = request.state.state
        if target not in _WORDS:
            expected = ", ".join(f"{word} ({number})" for number, word in _WORDS.items())
            raise ResultError(
                SetSimulationState.Response.INCORRECT_TRANSITION,
                f"state {target}, expected one of {expected}",
            )
        if target == self._state():
            code = SetSimulationState.Response.ALREADY_IN_TARGET_STATE
            raise ResultError(code, f"the simulation is already {_WORDS[target]}")
        if target == SimulationState.STATE_QUITTING:
            self._quit()
            return
        runner = self._host.active_runner()
        change = {
            SimulationState.STATE_STOPPED: runner.halt,
            SimulationState.STATE_PLAYING: runner.resume,
            SimulationState.STATE_PAUSED: runner.pause,
        }[target]
        try:
            runner.call(change)
        except InvalidStateError as error:
            raise ResultError(SetSimulationState.Response.STATE_TRANSITION_ERROR, str(error)) from error

    def reset(self, request: ResetSimulation.Request, response: ResetSimulation.Response) -> None:
        """Go back to the scene's start, time and state together: a run could not be repeated from half a reset.

        Raises:
            ResultError: The scope is a part of it.
        """
        scope = request.scope
        if scope != ResetSimulation.Request.SCOPE_DEFAULT and scope & _WHOLE != _WHOLE:
            raise ResultError(
                Result.RESULT_FEATURE_UNSUPPORTED,
                f"scope {scope}: time and state go back together; expected 0, 255, or both bits ({_WHOLE})",
            )
        runner = self._host.active_runner()
        runner.call(runner.reset)

    def _quit(self) -> None:
        runner = self._host.runner
        if runner is not None:
            runner.submit(runner.pause)
        self._host.finished.set()

    def _state(self) -> int:
        host = self._host
        if host.finished.is_set():
            return int(SimulationState.STATE_QUITTING)
        if host.runner is None:
            # The first version of the interfaces had no such state.
            return int(getattr(SimulationState, "STATE_NO_WORLD", SimulationState.STATE_STOPPED))
        return int(_STATES[host.runner.mode])


# Steps follow each other in one or two milliseconds: a client that reads ten times per second still gets each.
_FEEDBACK_DEPTH = 100
_TURN = 0.02  # s, after which other callbacks run while a step takes long


class Stepping:
    """Takes steps on the runner's thread, one request a step: other requests are served in between.

    Args:
        node: The node that offers the service and the action.
        host: The same node, as the holder of the runner.

    Attributes:
        offered: Names of the offered types.
    """

    def __init__(self, node: LifecycleNode, host: Host) -> None:
        self._node = node
        self._host = host
        self._busy = False
        group = ReentrantCallbackGroup()
        self.offered = (
            ["StepSimulation"] if offer_service(node, "StepSimulation", self._serve, group=group) else []
        )
        self.offered.append("SimulateSteps")
        self._server: ActionServer[SimulateSteps.Goal, SimulateSteps.Result, SimulateSteps.Feedback] = (
            ActionServer(
                node,
                SimulateSteps,
                "~/simulate_steps",
                self._execute,
                callback_group=group,
                feedback_pub_qos_profile=QoSProfile(depth=_FEEDBACK_DEPTH),
                cancel_callback=lambda request: CancelResponse.ACCEPT,
            )
        )

    def close(self) -> None:
        """Withdraw the action."""
        self._server.destroy()

    async def _serve(self, request: StepSimulation.Request, response: StepSimulation.Response) -> None:
        await self._take(request.steps, lambda done: True)

    async def _execute(self, goal: Goal) -> SimulateSteps.Result:
        result, steps = SimulateSteps.Result(), goal.request.steps

        def report(done: int) -> bool:
            feedback = SimulateSteps.Feedback(completed_steps=done, remaining_steps=steps - done)
            goal.publish_feedback(feedback)
            return not goal.is_cancel_requested

        try:
            taken = await self._take(steps, report)
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

    async def _take(self, steps: int, report: Callable[[int], bool]) -> int:
        # Returns the number of steps taken; `report` gets it after each, and ends them by returning False.
        if self._busy:
            raise InvalidStateError("steps are being taken already; wait for their end, or cancel them")
        if (mode := self._host.active_runner().mode) is not RunMode.PAUSED:
            raise InvalidStateError(f"the simulation is {mode.value}; steps are taken while it is paused")
        self._busy, time = True, 0.0
        try:
            for taken in range(steps):
                try:
                    time = await self._step(time)
                except InvalidStateError as error:
                    kind = type(error)
                    raise kind(f"{error}; {taken} of {steps} steps were taken") from error
                if not report(taken + 1):
                    return taken + 1
            return steps
        finally:
            self._busy = False

    async def _step(self, earliest: float) -> float:
        # Takes one step at a time that is not before `earliest`, and returns the new time.
        runner = self._host.active_runner()
        if runner.twin.time < earliest:
            raise InvalidStateError("the simulation went back to a start")
        future = runner.submit(runner.step)
        waiting = True
        while waiting:
            waiting = bool(futures.wait([future], _TURN).not_done)
            await _Turn(self._node)
        if future.cancelled():
            raise ResultError(
                Result.RESULT_INCORRECT_STATE, "the node was cleaned up before all steps were taken"
            )
        return future.result()


class _Turn:
    """Awaited, it lets the executor run all other work once."""

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node

    def __await__(self) -> Generator[None, None, None]:
        # An executor that is not woken would wait for other work first.
        if self._node.executor is not None:
            self._node.executor.wake()
        yield

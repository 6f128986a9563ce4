"""Standard simulator services that tell and change what the simulation does: state and reset."""

from __future__ import annotations

from typing import Any

from simulation_interfaces.msg import Result, SimulationState
from simulation_interfaces.srv import ResetSimulation, SetSimulationState

from ldcs_ros.ros.sim.runner import Mode, NotNow
from ldcs_ros.ros.simulator.answers import Refused
from ldcs_ros.ros.simulator.host import Host

# A simulation that cannot go on stands still, and there is no state of its own for that; the message says so.
_STATES = {
    Mode.STOPPED: SimulationState.STATE_STOPPED,
    Mode.RUNNING: SimulationState.STATE_PLAYING,
    Mode.PAUSED: SimulationState.STATE_PAUSED,
    Mode.FAILED: SimulationState.STATE_PAUSED,
    Mode.FINISHED: SimulationState.STATE_QUITTING,
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

    def get_state(self, request: Any, response: Any) -> None:
        """Tell the state; why the simulation cannot go on stands in the message."""
        response.state.state = self._state()
        if self._host.runner is not None:
            response.result.error_message = self._host.runner.failure

    def set_state(self, request: Any, response: Any) -> None:
        """Play, pause, stop (back to the start) or quit."""
        target = request.state.state
        if target not in _WORDS:
            expected = ", ".join(f"{word} ({number})" for number, word in _WORDS.items())
            raise Refused(
                SetSimulationState.Response.INCORRECT_TRANSITION,
                f"state {target}, expected one of {expected}",
            )
        if target == self._state():
            code = SetSimulationState.Response.ALREADY_IN_TARGET_STATE
            raise Refused(code, f"the simulation is already {_WORDS[target]}")
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
        except NotNow as error:
            raise Refused(SetSimulationState.Response.STATE_TRANSITION_ERROR, str(error)) from error

    def reset(self, request: Any, response: Any) -> None:
        """Go back to the scene's start, time and state together: a run could not be repeated from half a reset."""
        scope = request.scope
        if scope != ResetSimulation.Request.SCOPE_DEFAULT and scope & _WHOLE != _WHOLE:
            raise Refused(
                Result.RESULT_FEATURE_UNSUPPORTED,
                f"scope {scope}: time and state go back together; expected 0, 255, or both bits ({_WHOLE})",
            )
        runner = self._host.active_runner()
        runner.call(runner.reset)

    def _quit(self) -> None:
        runner = self._host.runner
        if runner is not None:
            runner.hand_in(runner.pause)
        self._host.finished.set()

    def _state(self) -> int:
        host = self._host
        if host.finished.is_set():
            return int(SimulationState.STATE_QUITTING)
        if host.runner is None:
            # The first version of the interfaces had no such state.
            return int(getattr(SimulationState, "STATE_NO_WORLD", SimulationState.STATE_STOPPED))
        return int(_STATES[host.runner.mode])

"""State and reset of the standard simulator services when the simulation cannot go on, without a graph."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest

pytest.importorskip("simulation_interfaces", reason="simulation_interfaces is not installed")

from fake_scene import RailScene
from simulation_interfaces.msg import SimulationState
from simulation_interfaces.srv import GetSimulationState, ResetSimulation, SetSimulationState

from ldcs_ros.ros.sim.pacing import AS_FAST_AS_POSSIBLE, Pacer
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.ros.simulator.answers import ResultError
from ldcs_ros.ros.simulator.control import Control
from ldcs_ros.twin.twin import Twin

pytestmark = pytest.mark.timed


@pytest.fixture
def failed():
    """A node's control whose simulation has diverged, and its scene."""
    scene = RailScene(diverges_at=0.05)
    runner = Runner(
        Twin(scene, diagnostics=False),
        Pacer(AS_FAST_AS_POSSIBLE, tolerance=0.02),
        on_failure=lambda reason: None,
        on_finish=lambda: None,
        on_reset=lambda: None,
    )
    runner.start()
    runner.call(runner.resume)
    end = time.monotonic() + 5.0
    while not runner.failure:
        assert time.monotonic() < end
        time.sleep(0.005)
    yield (
        Control(SimpleNamespace(finished=threading.Event(), runner=runner, active_runner=lambda: runner)),
        scene,
    )
    runner.stop()


def state_of(control):
    response = GetSimulationState.Response()
    control.report_state(None, response)
    return response.state.state, response.result.error_message


def set_state(control, state):
    request = SetSimulationState.Request(state=SimulationState(state=state))
    control.change_state(request, SetSimulationState.Response())


def test_a_simulation_that_cannot_go_on_stands_and_says_why(failed):
    control, _ = failed
    state, why = state_of(control)
    assert state == SimulationState.STATE_PAUSED
    assert "diverged" in why


def test_it_cannot_be_played_before_it_was_reset_or_stopped(failed):
    control, scene = failed
    with pytest.raises(ResultError, match="call reset") as refusal:
        set_state(control, SimulationState.STATE_PLAYING)
    assert refusal.value.code == SetSimulationState.Response.STATE_TRANSITION_ERROR
    scene.diverges_at = float("inf")
    set_state(control, SimulationState.STATE_STOPPED)
    assert state_of(control) == (SimulationState.STATE_STOPPED, "")
    set_state(control, SimulationState.STATE_PLAYING)
    assert state_of(control) == (SimulationState.STATE_PLAYING, "")


def test_a_reset_lets_it_run_again(failed):
    control, scene = failed
    scene.diverges_at = float("inf")
    control.reset(ResetSimulation.Request(), ResetSimulation.Response())
    assert state_of(control) == (SimulationState.STATE_PLAYING, "")

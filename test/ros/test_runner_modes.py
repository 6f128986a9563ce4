"""The runner without ROS: divergence, reset, commands in time, pacing."""

from __future__ import annotations

import threading
import time

import pytest
from fake_scene import Collector, RailScene

from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.ros.common.refusals import InvalidStateError
from ldcs_ros.ros.sim.pacing import AS_FAST_AS_POSSIBLE, Pacer
from ldcs_ros.ros.sim.runner import RunMode, Runner
from ldcs_ros.twin.twin import Twin

pytestmark = pytest.mark.timed


@pytest.fixture
def run():
    """Start a runner on rails; return it with its messages and reports."""
    runners = []

    def begin(scene=None, factor=1.0, **options):
        collected, told = Collector(), []
        twin = Twin(scene or RailScene(), sinks=[collected], diagnostics=False)
        runner = Runner(
            twin,
            Pacer(factor, tolerance=0.02),
            on_failure=told.append,
            on_finish=lambda: told.append("finished"),
            on_reset=lambda: told.append("reset"),
            **options,
        )
        runners.append(runner)
        runner.start()
        return runner, collected, told

    yield begin
    for runner in runners:
        runner.stop()


def until(condition, timeout=5.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_a_divergence_pauses_with_the_last_good_state_and_reset_brings_it_back(run):
    runner, collected, told = run(RailScene(diverges_at=0.05), factor=AS_FAST_AS_POSSIBLE)
    runner.call(runner.resume)
    until(lambda: runner.mode is RunMode.FAILED)
    assert "diverged" in told[0]
    assert [message[3] for message in collected.on("nodes")] == [0, 20_000_000, 40_000_000]
    with pytest.raises(InvalidStateError, match="call reset"):
        runner.call(runner.resume)
    with pytest.raises(InvalidStateError):
        runner.call(runner.step)
    runner.twin.scene.diverges_at = float("inf")
    runner.call(runner.reset)
    until(lambda: runner.twin.time > 0.1)
    assert runner.mode is RunMode.RUNNING


def test_a_reset_while_paused_shows_the_start_and_stays_paused(run):
    runner, collected, told = run()
    runner.call(runner.pause)
    runner.call(runner.step)
    runner.call(runner.step)
    runner.call(runner.reset)
    assert [message[3] for message in collected.on("nodes")] == [0, 20_000_000, 0]
    assert (runner.mode, told) == (RunMode.PAUSED, ["reset"])


def test_commands_act_in_the_order_in_which_they_came(run):
    runner, collected, _ = run()
    for value in range(100):
        runner.post("pressure_command", pressure_command([float(value)]))
    until(lambda: len(collected.on("pressure_command")) == 100)
    assert runner.twin.simulation.inputs.pressure.tolist() == [99.0, 99.0]


def test_it_finishes_at_the_duration_exactly(run):
    runner, collected, told = run(factor=AS_FAST_AS_POSSIBLE, duration=0.05)
    runner.call(runner.resume)
    until(lambda: told == ["finished"])
    assert runner.twin.simulation.time == 0.05
    assert [message[3] for message in collected.on("nodes")] == [0, 20_000_000, 40_000_000]


def test_stopping_vents_the_arms(run):
    runner, collected, _ = run()
    runner.post("pressure_command", pressure_command([1e5]))
    until(lambda: collected.on("pressure_command"))
    runner.stop()
    assert runner.twin.simulation.inputs.pressure.tolist() == [0.0, 0.0]


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def test_deadlines_are_absolute_and_lost_time_is_not_made_up_for():
    clock, wake = Clock(), threading.Event()
    wake.set()
    pacer = Pacer(2.0, tolerance=0.02, clock=clock)
    assert pacer.wait(10.0, wake)
    assert not pacer.wait(10.125, wake)
    clock.now = 0.0625
    assert pacer.wait(10.125, wake)
    clock.now = 0.5
    assert pacer.wait(10.25, wake)
    assert pacer.overruns == 1
    assert not pacer.wait(10.375, wake)
    clock.now = 0.5625
    assert pacer.wait(10.375, wake)
    assert pacer.overruns == 1
    assert pacer.take_worst_lateness() == 0.375


def test_a_thousand_deadlines_do_not_drift(run):
    runner, _collected, _ = run(factor=20.0)
    began = time.monotonic()
    runner.call(runner.resume)
    until(lambda: runner.twin.time >= 20.0)
    assert time.monotonic() - began == pytest.approx(1.0, abs=0.1)

"""Whatever anybody asks for, and whenever, set-points stay within bounds and slew: at the gate and at the link."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_bench import HandClock

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.gate import Gate, GateState, Mode
from ldcs_ros.rig.limits import LastStage, Limits

LIMITS = Limits(pressure=100e3, slew=200e3)
anything = st.floats(allow_nan=True, allow_infinity=True)
pauses = st.floats(0.0, 3.0)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(pauses, anything, anything), max_size=30))
def test_the_gate_never_leaves_bounds_and_slew(course):
    clock = HandClock()
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.tick()
    gate.arm()
    before = gate.tick()
    for pause, left, right in course:
        try:
            gate.command([left, right])
        except BridgeError:
            pass
        clock.pass_time(pause)
        now = gate.tick()
        assert (now >= 0.0).all() and (now <= LIMITS.pressure).all()
        assert (now - before <= LIMITS.slew * pause + 1e-6).all()
        assert (before - now <= max(LIMITS.slew, LIMITS.vent_rate) * pause + 1e-6).all()
        before = now


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(pauses, st.one_of(st.none(), st.tuples(anything, anything))), max_size=30))
def test_the_last_stage_holds_without_the_gate(course):
    clock = HandClock()
    stage = LastStage(LIMITS, clock)
    before = np.zeros(2)
    for pause, offered in course:
        clock.pass_time(pause)
        stage.offer(None if offered is None else np.array(offered))
        now = stage.next()
        if now is None:
            before = np.zeros(2)
            continue
        assert (now >= 0.0).all() and (now <= LIMITS.pressure).all()
        assert (now - before <= 1.5 * LIMITS.slew * pause + 1e-6).all()
        before = now


def test_the_last_stage_ramps_down_when_the_gate_dies(clock):
    stage = LastStage(LIMITS, clock)
    for _ in range(100):
        stage.offer(np.array([80e3, 80e3]))
        clock.pass_time(0.01)
        top = stage.next()
    assert top.tolist() == [80e3, 80e3]
    course = []
    for _ in range(100):
        clock.pass_time(0.01)
        course.append(stage.next()[0])
    assert stage.starved
    full = [value for value in course if value == 80e3]
    assert len(full) == pytest.approx(LIMITS.command_timeout / 0.01, abs=2)
    assert course[-1] == 0.0 and course == sorted(course, reverse=True)


def test_the_last_stage_counts_what_it_had_to_correct(clock):
    stage = LastStage(LIMITS, clock)
    for wrong in ([2e5, 0.0], [-1.0, 0.0], [float("nan"), 0.0], [1.0, 2.0, 3.0]):
        stage.offer(np.array(wrong))
        clock.pass_time(0.01)
        stage.next()
    assert stage.corrections == 4


@pytest.mark.parametrize("mode", [Mode.SHADOW, Mode.MIRROR])
def test_a_closed_gate_sends_nothing(mode, clock):
    gate = Gate(mode, LIMITS, clock)
    with pytest.raises(BridgeError, match="commands nothing"):
        gate.command([1e4])
    assert gate.tick() is None and gate.state is GateState.CLOSED


def test_live_sends_nothing_until_it_is_armed(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    with pytest.raises(BridgeError, match="not armed: call arm first"):
        gate.command([1e4])
    assert gate.tick() is None
    with pytest.raises(BridgeError, match="the rig is silent"):
        gate.arm(["the rig is silent"])
    gate.arm()
    assert gate.tick().tolist() == [0.0, 0.0]


def test_a_vent_is_latched_ramped_and_mended_only_by_arming(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.tick()
    gate.arm()
    for _ in range(100):
        gate.command([80e3])
        clock.pass_time(0.01)
        gate.tick()
    clock.pass_time(LIMITS.command_timeout + 0.01)
    gate.tick()
    course = []
    for _ in range(40):
        clock.pass_time(0.01)
        course.append(gate.tick()[0])
    assert course == sorted(course, reverse=True) and course[-1] == 0.0
    assert max(np.abs(np.diff(course))) <= LIMITS.vent_rate * 0.0101
    with pytest.raises(BridgeError, match="vented .*no command for 0.4 s.*call arm"):
        gate.command([1e4])
    gate.arm()
    gate.command([1e4])
    assert gate.state is GateState.ARMED and gate.trips == 1


def test_the_watchdog_waits_for_the_first_command(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.arm()
    clock.pass_time(100.0)
    gate.tick()
    assert gate.state is GateState.ARMED

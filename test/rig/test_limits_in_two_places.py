"""For every sequence of commands, set-points stay within bounds and slew: at the gate and at the link."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_bench import HandClock

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.gate import Gate, GateState, Mode
from ldcs_ros.rig.limits import LONGEST_STEP, Limits
from ldcs_ros.rig.output.limiter import OutputLimiter, OutputState

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
        for last, value in zip(before, now, strict=True):
            assert 0.0 <= value <= LIMITS.pressure
            assert value - last <= LIMITS.slew * pause + 1e-6
            assert last - value <= max(LIMITS.slew, *LIMITS.vent_rates) * pause + 1e-6
        before = now


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(pauses, st.integers(0, 3), anything, anything), max_size=30))
def test_the_output_limiter_holds_without_the_gate(course):
    clock = HandClock()
    limiter = OutputLimiter(LIMITS, clock)
    before = (0.0, 0.0)
    for pause, epoch, left, right in course:
        clock.pass_time(pause)
        limiter.set_target((left, right), epoch, clock())
        now = limiter.next()
        if now is None:
            continue
        for last, value in zip(before, now, strict=True):
            assert 0.0 <= value <= LIMITS.pressure
            assert value - last <= 1.5 * LIMITS.slew * min(pause, LONGEST_STEP) + 1e-6
        before = now


def active(clock, pressure=80e3):
    """A limiter that has followed the gate up to a pressure."""
    limiter = OutputLimiter(LIMITS, clock)
    for _ in range(100):
        limiter.set_target((pressure, pressure), 1, clock())
        clock.pass_time(0.01)
        limiter.next()
    assert limiter.sent == (pressure, pressure) and limiter.state is OutputState.ACTIVE
    return limiter


def test_the_output_limiter_vents_when_the_gate_dies(clock):
    limiter = active(clock)
    course = []
    for _ in range(100):
        clock.pass_time(0.01)
        course.append(limiter.next()[0])
    assert limiter.state is OutputState.VENTED and "silent" in limiter.reason
    full = [value for value in course if value == 80e3]
    assert len(full) == pytest.approx(LIMITS.command_timeout / 0.01, abs=2)
    assert course[-1] == 0.0 and course == sorted(course, reverse=True)


def test_a_stopped_output_process_vents_and_follows_no_set_point_that_waited_meanwhile(clock):
    limiter = active(clock)
    clock.pass_time(LIMITS.command_timeout + 0.01)
    limiter.set_target((80e3, 80e3), 1, clock())
    limiter.next()
    assert limiter.state is OutputState.VENTED and "stopped or starved" in limiter.reason
    for _ in range(60):
        limiter.set_target((80e3, 80e3), 1, clock())
        clock.pass_time(0.01)
        limiter.next()
    assert limiter.sent == (0.0, 0.0)


def test_only_a_fresh_set_point_of_a_later_arming_ends_a_vent(clock):
    limiter = active(clock)
    limiter.vent("a test")
    clock.pass_time(1.0)
    limiter.set_target((10e3, 10e3), 2, clock() - LIMITS.command_timeout - 0.01)
    assert limiter.state is OutputState.VENTED
    limiter.set_target((10e3, 10e3), 2, clock())
    assert limiter.state is OutputState.ACTIVE and limiter.sent == (0.0, 0.0)


def test_a_vent_from_idle_ramps_down_from_what_the_rig_works_to(clock):
    limiter = OutputLimiter(LIMITS, clock)
    limiter.vent("a test", start=(80e3, 300e3))
    clock.pass_time(0.01)
    left, right = limiter.next()
    fall = LIMITS.vent_rates[0] * 0.01
    assert left == pytest.approx(80e3 - fall) and right == pytest.approx(LIMITS.pressure - fall)


@pytest.mark.parametrize("wrong", [(2e5, 0.0), (-1.0, 0.0), (float("nan"), 0.0), (1.0, 2.0, 3.0)])
def test_the_output_limiter_counts_what_it_had_to_clip(wrong, clock):
    limiter = OutputLimiter(LIMITS, clock)
    limiter.set_target(wrong, 1, clock())
    clock.pass_time(0.01)
    limiter.next()
    assert limiter.clipped_count == 1


def test_the_gate_passes_the_limit_and_nothing_above_it(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.arm()
    gate.command([LIMITS.pressure])
    for above in (LIMITS.pressure + 1.0, -1.0):
        with pytest.raises(BridgeError, match="over limit"):
            gate.command([above])
    for _ in range(200):
        gate.command([LIMITS.pressure])
        clock.pass_time(0.01)
        gate.tick()
    assert gate.setpoint == (LIMITS.pressure, LIMITS.pressure)


@pytest.mark.parametrize("beyond", [0.0, 1.0, 1e4])
def test_the_output_stage_sends_the_limit_and_nothing_above_it(beyond, clock):
    limiter = active(clock, LIMITS.pressure)
    ramp = limiter.clipped_count  # a jump is slewed, which counts too
    for _ in range(10):
        limiter.set_target((LIMITS.pressure + beyond, LIMITS.pressure), 1, clock())
        clock.pass_time(0.01)
        limiter.next()
    assert limiter.sent == (LIMITS.pressure, LIMITS.pressure)
    assert limiter.clipped_count - ramp == (10 if beyond else 0)


def test_commands_that_are_old_or_from_before_the_arming_move_nothing(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    clock.pass_time(0.2)
    gate.arm()
    with pytest.raises(BridgeError, match="heard before the arming"):
        gate.command([1e4], heard=clock() - 0.1)
    for _ in range(100):
        clock.pass_time(0.01)
        gate.tick()
    with pytest.raises(BridgeError, match="too old"):
        gate.command([1e4], heard=clock() - LIMITS.command_timeout - 0.01)
    gate.tick()
    assert gate.setpoint == (0.0, 0.0) and gate.refused["too old"] == 2


def test_a_late_tick_vents_whatever_came_meanwhile(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.arm()
    for _ in range(50):
        gate.command([80e3])
        clock.pass_time(0.01)
        gate.tick()
    clock.pass_time(LIMITS.command_timeout + 0.01)
    with pytest.raises(BridgeError, match="stopped or starved"):
        gate.command([80e3])
    assert gate.state is GateState.VENTED


def test_disarm_vents_in_mode_live_also_before_the_first_arming(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    assert gate.disarm() is False
    assert gate.state is GateState.VENTED and gate.tick() == (0.0, 0.0)
    listening = Gate(Mode.SHADOW, LIMITS, clock)
    listening.disarm()
    assert listening.state is GateState.CLOSED and listening.tick() is None


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
    assert gate.tick() == (0.0, 0.0)


def test_a_vent_is_latched_ramped_and_mended_only_by_arming(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.tick()
    gate.arm()
    for _ in range(100):
        gate.command([80e3])
        clock.pass_time(0.01)
        gate.tick()
    for _ in range(42):
        clock.pass_time(0.01)
        gate.tick()
    course = []
    for _ in range(40):
        clock.pass_time(0.01)
        course.append(gate.tick()[0])
    assert course == sorted(course, reverse=True) and course[-1] == 0.0
    assert max(np.abs(np.diff(course))) <= LIMITS.vent_rates[0] * 0.0101
    with pytest.raises(BridgeError, match=r"vented .*no command for 0.4 s.*call arm"):
        gate.command([1e4])
    gate.arm()
    gate.command([1e4])
    assert gate.state is GateState.ARMED and gate.trips == 1


def test_an_arming_without_a_command_expires(clock):
    gate = Gate(Mode.LIVE, LIMITS, clock)
    gate.arm()
    for _ in range(int(LIMITS.arm_timeout / 0.1) + 1):
        assert gate.state is GateState.ARMED
        clock.pass_time(0.1)
        gate.tick()
    assert gate.state is GateState.VENTED and "within 5 s after arming" in gate.reason

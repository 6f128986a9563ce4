"""The limits' numbers: defaults, bounds, the slew and the ramp of a vent by their formulas, and the gate's times."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.gate import Gate, GateState, Mode
from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.limiter import OutputLimiter

RANGES = {
    "pressure": (1.0, 1e7),
    "slew": (1.0, 1e9),
    "vent_ramp": (0.01, 60.0),
    "vent_time": (0.01, 600.0),
    "command_timeout": (0.01, 60.0),
    "rig_timeout": (0.01, 60.0),
    "arm_timeout": (0.1, 600.0),
}


def test_without_values_a_rig_has_the_documented_limits():
    limits = Limits()
    assert (limits.pressure, limits.slew) == (140e3, 400e3)
    assert (limits.vent_ramp, limits.vent_time) == (0.3, 1.0)
    assert (limits.command_timeout, limits.rig_timeout, limits.arm_timeout) == (0.4, 0.4, 5.0)


@pytest.mark.parametrize(("name", "value"), [(name, end) for name, ends in RANGES.items() for end in ends])
def test_the_ends_of_a_range_are_limits_and_what_lies_beyond_is_refused(name, value):
    low, high = RANGES[name]
    base = Limits(vent_ramp=0.01, vent_time=600.0)
    if name != "vent_time" or value == high:
        assert getattr(replace(base, **{name: value}), name) == value
    beyond = 0.999 * low if value == low else 1.001 * high
    with pytest.raises(BridgeError, match=f"limits.{name}"):
        replace(base, **{name: beyond})
    for wrong in (True, "1", None):
        with pytest.raises(BridgeError, match=f"limits.{name}"):
            replace(base, **{name: wrong})


def test_a_vent_takes_at_least_its_ramp():
    assert Limits(vent_ramp=1.0, vent_time=1.0).vent_rates == (140e3, 140e3)
    with pytest.raises(BridgeError, match="at least vent_ramp"):
        Limits(vent_ramp=1.001, vent_time=1.0)


def test_a_step_goes_slew_times_duration_and_a_tenth_of_a_second_at_most():
    limits = Limits(pressure=100e3, slew=200e3)
    assert limits.step((10e3, 50e3), (100e3, 0.0), 0.05) == (20e3, 40e3)
    assert limits.step((10e3, 50e3), (100e3, 0.0), 3.0) == (30e3, 30e3)
    assert limits.step((10e3, 99e3), (100e3, 100e3), -1.0) == (10e3, 99e3)
    assert limits.step((99e3, 99e3), (1e9, 1e5), 0.1) == (100e3, 100e3)
    assert limits.bounded((-1.0, 3.0)) + limits.bounded((2e5, float("nan"))) == (0.0, 3.0, 100e3, 0.0)


def test_a_vent_falls_along_the_ramp_of_the_largest_pressure():
    limits = Limits(pressure=90e3, slew=1e3, vent_ramp=0.3)
    assert limits.vent_rates == pytest.approx((300e3, 300e3))
    assert limits.vent((90e3, 10e3), 0.1) == pytest.approx((60e3, 0.0))


def test_commands_may_be_silent_for_their_timeout_and_no_longer(clock):
    limits = Limits(command_timeout=0.5)
    gate = Gate(Mode.LIVE, limits, clock)
    gate.arm()
    gate.command([5e3])
    for _ in range(49):
        clock.pass_time(0.01)
        gate.tick()
    assert gate.state is GateState.ARMED
    for _ in range(2):
        clock.pass_time(0.01)
        gate.tick()
    assert gate.state is GateState.VENTED and gate.trips == 1 and 0.0 <= gate.venting_for < 0.011
    before = gate.venting_for
    clock.pass_time(0.25)
    assert gate.venting_for - before == pytest.approx(0.25)


def test_the_gate_counts_from_zero_and_each_refusal_by_its_reason(clock):
    gate = Gate(Mode.LIVE, Limits(arms=("left", "middle", "right")), clock)
    assert (gate.epoch, gate.trips, gate.accepted, gate.setpoint) == (0, 0, 0, (0.0, 0.0, 0.0))
    assert gate.venting_for is None and gate.state is GateState.DISARMED
    gate.arm()
    gate.command([1e3])
    gate.command([1e3, 2e3, 3e3])
    for wrong, reason in (([1.0, 2.0], "wrong size"), ([float("inf")] * 3, "not a number")):
        with pytest.raises(BridgeError, match=reason):
            gate.command(wrong)
    assert gate.epoch == 1 and gate.accepted == 2 and gate.refused == {"wrong size": 1, "not a number": 1}
    clock.pass_time(0.1)
    assert gate.tick() == (1e3, 2e3, 3e3)
    with pytest.raises(BridgeError, match="armed already"):
        gate.arm()


def test_a_late_tick_is_one_of_more_than_the_command_timeout(clock):
    gate = Gate(Mode.LIVE, Limits(command_timeout=0.5), clock)
    gate.arm()
    gate.command([5e3])
    clock.pass_time(0.49)
    assert gate.tick() is not None and gate.state is GateState.ARMED
    gate.command([5e3])
    clock.pass_time(0.52)
    gate.tick()
    assert gate.state is GateState.VENTED and gate.reason == "the bridge was stopped or starved for 0.52 s"


def test_the_output_stage_slews_at_most_half_a_period_more_than_the_gate(clock):
    limits = Limits(pressure=100e3, slew=200e3)
    limiter = OutputLimiter(limits, clock)
    limiter.set_target((0.0, 0.0), 1, clock())
    limiter.next()
    for expected in (3e3, 6e3, 9e3):  # 1.5 x 200 kPa/s x 10 ms
        limiter.set_target((90e3, 90e3), 1, clock())
        clock.pass_time(0.01)
        assert limiter.next() == pytest.approx((expected, expected))
    for expected in (6e3, 3e3, 0.0, 0.0):
        limiter.set_target((0.0, 0.0), 1, clock())
        clock.pass_time(0.01)
        assert limiter.next() == pytest.approx((expected, expected))

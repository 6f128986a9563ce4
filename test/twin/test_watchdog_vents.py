"""Silence of a sender vents the arms along a ramp and stays so until rearm."""

from __future__ import annotations

import numpy as np
import pytest
from fake_scene import RailScene

from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.diagnostics import OK, WARN
from ldcs_ros.messages.messages import pressure_command, torque_command, wrench_command
from ldcs_ros.twin.status import twin_statuses
from ldcs_ros.twin.watchdog import Watchdog


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def guarded(run, clock, drive="pressure", **limits):
    return run(RailScene(drive=drive), watchdog=Watchdog(clock, **limits))


def test_a_twin_without_commands_is_left_alone(run, clock):
    twin, _ = guarded(run, clock, timeout=0.3)
    clock.now += 1000.0
    assert not twin.check_watchdog()
    assert twin.watchdog.state == "idle"


def test_a_stale_pressure_is_vented_along_a_ramp(run, clock):
    twin, collected = guarded(run, clock, timeout=0.3)
    twin.advance_to(0.0)
    twin.receive("pressure_command", pressure_command([1e5, 2e5]))
    clock.now += 0.29
    assert not twin.check_watchdog()
    clock.now += 0.02
    assert twin.check_watchdog()
    assert not twin.check_watchdog()
    twin.advance_to(0.26)
    half = twin.simulation.inputs.pressure
    assert np.allclose(half, [0.48e5, 0.96e5])
    twin.advance_to(1.0)
    assert twin.simulation.inputs.pressure.tolist() == [0.0, 0.0]
    ramp = [decode(m[1], m[2]).data[1] for m in collected.on("pressure_command")]
    assert ramp == sorted(ramp, reverse=True)
    assert len(ramp) == 1 + 1 + 25


def test_a_stale_torque_is_vented_too(run, clock):
    twin, collected = guarded(run, clock, drive="torque", timeout=0.3)
    twin.receive("torque_command", torque_command(0, ["left_joint_1"], np.array([0.4])))
    clock.now += 1.0
    twin.check_watchdog()
    twin.advance_to(1.0)
    assert not twin.simulation.inputs.torque.any()
    assert len(collected.on("torque_command")) > 10


def test_a_tripped_watchdog_refuses_commands_until_rearmed(run, clock):
    twin, _ = guarded(run, clock, timeout=0.3)
    twin.receive("pressure_command", pressure_command([1e5]))
    clock.now += 1.0
    twin.check_watchdog()
    assert twin.receive("pressure_command", pressure_command([1e5])).startswith("vented")
    assert twin.commands.refused["vented"] == 1
    assert twin.rearm()
    assert twin.receive("pressure_command", pressure_command([1e5])) is None
    twin.advance_to(1.0)
    assert twin.simulation.inputs.pressure.tolist() == [1e5, 1e5]


def test_the_diagnostics_warn_while_the_watchdog_is_tripped_and_not_before_or_after(run, clock):
    twin, _ = guarded(run, clock, timeout=0.3)

    def level():
        return next(one.level for one in twin_statuses({}, twin.commands, twin.watchdog) if one.name == "watchdog")

    twin.receive("pressure_command", pressure_command([1e5]))
    assert level() == OK
    clock.now += 1.0
    twin.check_watchdog()
    assert level() == WARN
    twin.rearm()
    assert level() == OK


def test_a_refused_command_does_not_feed_the_watchdog(run, clock):
    twin, _ = guarded(run, clock, timeout=0.3)
    twin.receive("pressure_command", pressure_command([1e5]))
    for _ in range(4):
        clock.now += 0.1
        twin.receive("pressure_command", pressure_command([float("nan")]))
    assert twin.check_watchdog()


def test_a_pause_does_not_count_as_silence(run, clock):
    twin, _ = guarded(run, clock, timeout=0.3)
    twin.receive("pressure_command", pressure_command([1e5]))
    clock.now += 0.2
    twin.watchdog.suspend()
    clock.now += 50.0
    twin.watchdog.resume()
    assert not twin.check_watchdog()
    clock.now += 0.2
    assert twin.check_watchdog()


def test_each_wrench_has_its_own_time(run, clock):
    twin, collected = guarded(run, clock, wrench_timeout=0.3)
    twin.receive("external_wrench", wrench_command(0, "P0", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    clock.now += 0.2
    twin.receive("external_wrench", wrench_command(0, "P1", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    clock.now += 0.2
    twin.check_watchdog()
    assert set(twin.simulation.inputs.wrenches) == {"P1"}
    last = decode("geometry_msgs/msg/WrenchStamped", collected.on("external_wrench")[-1][2])
    assert (last.header.frame_id, last.wrench.force.z) == ("P0", 0.0)


def test_timeouts_of_zero_never_trip(run, clock):
    twin, _ = guarded(run, clock)
    twin.receive("pressure_command", pressure_command([1e5]))
    twin.receive("external_wrench", wrench_command(0, "P0", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    clock.now += 1e6
    assert not twin.check_watchdog()
    assert twin.simulation.inputs.wrenches
    assert twin.watchdog.state == "off"


def test_a_vent_at_once_leaves_nothing(run):
    twin, collected = run()
    twin.receive("pressure_command", pressure_command([1e5]))
    twin.vent(0.0)
    assert twin.simulation.inputs.pressure.tolist() == [0.0, 0.0]
    assert decode(*collected[-1][1:3]).data.tolist() == [0.0, 0.0]

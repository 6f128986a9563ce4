"""Each fault of a rig, on each transport: the diagnostics, the limits, and the vent in time."""

from __future__ import annotations

import pytest
from rig_bench import LIMIT, WORKING, Bench, HandClock

from ldcs_ros.messages.diagnostics import ERROR, WARN

pytestmark = pytest.mark.timed

# Diagnostics of each fault: entry, level, words.
SEEN = {
    "mute": ("readings", ERROR, "silent"),
    "delay": ("readings", ERROR, "old"),
    "stuck": ("valves", ERROR, "left does not move: stuck valve?"),
    "leak": ("valves", ERROR, "right too low: leak"),
    "duplicates": ("readings", WARN, "duplicate"),
    "clock_jump": ("clocks", WARN, "jumped by"),
    "nan": ("readings", ERROR, "left"),
    "drop": ("readings", ERROR, "silent"),
}
VALUES = {
    "mute": True,
    "delay": 0.6,
    "stuck": "left",
    "leak": "right",
    "duplicates": 5,
    "clock_jump": 2.0,
    "nan": "left",
    "drop": True,
}
# These leave fresh, valid readings: the arms work on, and vent when the operator falls silent.
HARMLESS = ("duplicates", "clock_jump")
# On a wire some faults show as a broken connection, and registers are polled: there are no copies of them.
ON_THE_WIRE = {
    "modbus": {
        "mute": ("links", ERROR, "does not answer"),
        "delay": ("links", ERROR, "does not answer"),
        "drop": ("links", ERROR, "valve island"),
    },
    "serial": {"drop": ("links", ERROR, "serial line"), "nan": ("readings", ERROR, "left")},
}
CASES = [("topics", fault) for fault in SEEN]
CASES += [("modbus", fault) for fault in ("mute", "delay", "drop")]
CASES += [("serial", fault) for fault in ("duplicates", "nan", "drop")]


@pytest.mark.parametrize(("transport", "fault"), CASES)
def test_the_operator_sees_each_fault_and_the_arms_vent_in_time(transport, fault):
    bench = Bench(transport, clock=HandClock() if transport == "topics" else None)
    limits = bench.rig_file.limits
    in_time = limits.command_timeout + limits.vent_time
    try:
        bench.pressurise()
        bench.seen()
        bench.rig.set_fault(fault, VALUES[fault])
        if fault in HARMLESS:
            bench.run(0.5)
            assert not bench.vented
            assert bench.rig.pressure.min() > 0.8 * WORKING
            seen = bench.seen()
            bench.operator = None
            bench.run(in_time, bench.is_empty)
            assert "no command" in bench.bridge.gate.reason
        elif fault == "stuck":
            bench.operator = [0.4 * WORKING, 0.4 * WORKING]
            bench.run(in_time, lambda: bench.is_empty("right"))
            seen = bench.seen()
            bench.run(limits.vent_time, lambda: "left still holds pressure: cut" in bench.seen()["gate"][1])
        else:
            took = bench.run(in_time, lambda: bench.vented)
            early = bench.seen()
            bench.run(in_time - took, bench.is_empty)
            late = bench.seen()
            # A lost connection shows at once, stale readings a moment later; a leak is gone once it is vented.
            seen = {name: max(early[name], late[name]) for name in late}
            if fault == "delay":
                seen["readings"] = late["readings"]
        entry, level, words = ON_THE_WIRE.get(transport, {}).get(fault, SEEN[fault])
        assert seen[entry][0] == level and words in seen[entry][1], seen
        assert bench.vented
        assert bench.bridge.gate.setpoint == (0.0, 0.0)
        bench.check_limits()
    finally:
        bench.close()


@pytest.mark.parametrize("transport", ["topics", "modbus", "serial"])
def test_a_silent_operator_vents_the_arms_in_time(transport):
    bench = Bench(transport, clock=HandClock() if transport == "topics" else None)
    limits = bench.rig_file.limits
    try:
        bench.pressurise()
        bench.operator = None
        bench.run(limits.command_timeout + limits.vent_time, bench.is_empty)
        assert bench.seen()["gate"] == (ERROR, "vented: no command for 0.4 s; call arm after the repair")
        bench.check_limits()
    finally:
        bench.close()


def test_after_a_lost_connection_it_comes_back_and_arms_only_when_asked():
    bench = Bench("modbus")
    try:
        bench.pressurise()
        bench.rig.set_fault("drop", True)
        bench.run(2.0, bench.is_empty)
        bench.rig.set_fault("drop", False)
        bench.run(3.0, lambda: not bench.bridge.preconditions())
        assert bench.is_empty() and bench.vented and "vented" in bench.refused
        bench.bridge.arm()
        bench.run(3.0, lambda: bench.rig.pressure.min() > 0.8 * WORKING)
        bench.check_limits()
    finally:
        bench.close()


@pytest.mark.parametrize("mode", ["shadow", "mirror"])
def test_listening_modes_command_nothing(mode, clock):
    bench = Bench("topics", mode=mode, clock=clock, controller="steps")
    assert (bench.bridge.estimator is not None) == (mode == "mirror")
    for arm in ("left", "right"):
        assert f"no pressure of {arm} has been measured yet" in bench.bridge.preconditions()
    bench.operator = [WORKING, WORKING]
    bench.run(3.0)
    assert bench.rig.highest_setpoint == 0.0
    assert "commands nothing" in bench.refused
    with pytest.raises(ValueError, match="commands nothing"):
        bench.bridge.arm()
    assert bench.seen()["gate"][1] == f"{mode}: commands nothing"
    assert abs(bench.bridge.measured["left"] - bench.rig.pressure[0]) < 0.05 * LIMIT


def test_the_twin_beside_a_rig_like_itself_shows_small_residuals(clock):
    from ldcs_ros.mock_rig.rig import Hidden

    alike = Hidden(stiffness=1.0, gain=1.0, load=0.0)
    bench = Bench("topics", mode="shadow", clock=clock, controller="wave", hidden=alike)
    bench.run(3.0)
    residual = bench.bridge.follower.squared_residual
    assert all(square**0.5 < 2e-3 for square in residual.values()), residual


def test_an_operator_cannot_exceed_the_limits(clock):
    bench = Bench("topics", clock=clock)
    bench.pressurise()
    for wrong in ([float("nan")] * 2, [float("inf")] * 2, [LIMIT * 1.01] * 2, [-1.0] * 2, [1e4] * 3):
        bench.operator = wrong
        bench.run(0.05)
        assert bench.bridge.gate.setpoint == (WORKING, WORKING)
    bench.run(0.5)
    assert bench.vented, "refused commands do not feed the watchdog"
    bench.check_limits()

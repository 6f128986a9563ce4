"""A rig of three arms: limits, registers, lines, faults and vents of each arm; a file that does not fit is refused."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time

import numpy as np
import pytest
from rig_bench import SMALL, THREE, Bench

from ldcs_ros import load_scene
from ldcs_ros.errors import BridgeError
from ldcs_ros.mock_rig.modbus_server import ModbusServer
from ldcs_ros.mock_rig.rig import LIMIT, Hidden, MockRig, hidden_scene
from ldcs_ros.mock_rig.serial_port import SerialPort
from ldcs_ros.mock_rig.server import MockRigServer
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import Gate, Mode
from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.limiter import OutputLimiter
from ldcs_ros.rig.output.monitor import WriteMonitor
from ldcs_ros.rig.output.serial_line import SerialDevice, SerialSettings
from ldcs_ros.rig.output.stage import OutputStage
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.rig.vent import vent_rig

pytestmark = pytest.mark.timed

ARMS = ("left", "middle", "right")
HIGHEST = {"left": 120e3, "middle": 40e3, "right": 90e3}
SLEW = {"left": 400e3, "middle": 100e3, "right": 300e3}
LIMITS = Limits(ARMS, HIGHEST, SLEW)
ASKED = (100e3, 30e3, 60e3)
BRIDGE = """
import json, sys, time
from ldcs_ros import load_scene
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import Mode
from ldcs_ros.rig.rig_file import load_rig
scene, rig, asked = json.loads(sys.argv[1])
bridge = Bridge(load_scene(scene), load_rig(rig), mode=Mode("live"), clock=time.monotonic)
bridge.start()
while bridge.preconditions():
    bridge.step()
    time.sleep(0.01)
bridge.arm()
while True:
    bridge.command(asked)
    bridge.step()
    time.sleep(0.01)
"""


@pytest.fixture
def modbus():
    """Return a rig of three arms without a watchdog of its own and the content of its rig file; end it afterwards."""
    scene = hidden_scene(load_scene(THREE), Hidden())
    rig = MockRig(scene, clock=time.monotonic, bus_timeout=math.inf)
    server = ModbusServer(rig)
    stand = MockRigServer(rig, [server])
    stand.start()
    yield (
        rig,
        {"arms": list(ARMS), "limits": {"pressure": HIGHEST, "slew": SLEW}, "links": [server.describe()]},
    )
    stand.stop()


def wait_until(condition, timeout):
    """Wait for a condition; return how long it took [s]."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < timeout, f"not within {timeout} s"
        time.sleep(0.01)
    return time.monotonic() - start


def test_three_pressures_arrive_over_modbus_and_a_killed_bridge_leaves_none(modbus):
    rig, file = modbus
    bridge = subprocess.Popen([sys.executable, "-c", BRIDGE, json.dumps([THREE, file, ASKED])])
    try:
        wait_until(lambda: rig.setpoint == pytest.approx(ASKED, abs=100.0), 25.0)
        wait_until(lambda: rig.pressure == pytest.approx(np.array(ASKED), rel=0.02), 3.0)
        bridge.kill()
        bridge.wait()
        promise = LIMITS.command_timeout + LIMITS.vent_time
        assert wait_until(lambda: rig.setpoint == (0.0, 0.0, 0.0), 5.0) < promise
        wait_until(lambda: rig.pressure.max() < 0.05 * HIGHEST["middle"], 2.0)
        assert rig.lowest_setpoint == 0.0 and rig.highest_setpoint <= ASKED[0]
    finally:
        bridge.kill()
        bridge.wait()


def test_a_vent_without_a_scene_reaches_each_arm_that_the_rig_file_names(modbus):
    rig, file = modbus
    assert rig.command(ASKED) == ""
    assert vent_rig(load_rig(file)) == ""
    assert rig.setpoint == (0.0, 0.0, 0.0)


def test_each_probe_is_that_of_its_point_in_any_order_of_the_scene(clock):
    # The tracker numbers its probes in an order of its own, and has none on P2.
    points = {**THREE["points"], "P2": {"x": 0.05, "y": 0.02}}
    scene = {**THREE, "points": points, "sensors": {**THREE["sensors"], "tracker": {"points": ["P1", "P0"]}}}
    bench = Bench("topics", clock=clock, scene=scene, hidden=Hidden(stiffness=1.0, gain=1.0, load=0.0))
    bench.run(0.3)
    assert bench.rig.probes == ("P1", "P0")
    residuals = {status.name: status for status in bench.health.read()}["residuals"]
    assert residuals.values["P0 [mm]"] < 0.5 and residuals.values["P1 [mm]"] < 0.5
    assert "P2" not in residuals.message


def test_hidden_stiffness_is_that_of_the_material_where_a_scene_has_one():
    stiff, soft = (
        load_scene("three_arms").edited({"lattice.nodes": [7, 4]}).stiffened(factor).build()
        for factor in (1.2, 1.0)
    )
    rig = hidden_scene(load_scene("three_arms").edited({"lattice.nodes": [7, 4]}), Hidden(1.2)).build()
    springs = [sim.model.terms[0] for sim in (stiff, soft, rig)]
    np.testing.assert_allclose(springs[0].k, 1.2 * springs[1].k)
    np.testing.assert_allclose(springs[2].k, springs[0].k)
    np.testing.assert_allclose(springs[2].c, springs[1].c)


@pytest.mark.parametrize("fault", ["stuck", "leak", "nan"])
def test_a_fault_of_the_middle_arm_vents_the_others(clock, fault):
    bench = Bench("topics", clock=clock, scene=THREE, limits={"pressure": HIGHEST, "slew": SLEW})
    bench.pressurise(*ASKED)
    assert bench.rig.pressure == pytest.approx(np.array(ASKED), rel=0.1)
    bench.rig.set_fault(fault, "middle")
    if fault == "stuck":
        bench.operator = [50e3, 10e3, 30e3]
    bench.run(LIMITS.command_timeout + LIMITS.vent_time + 0.1)
    assert bench.vented and "middle" in bench.bridge.gate.reason
    assert bench.is_empty("left", "right")
    assert bench.is_empty("middle") == (fault != "stuck")


def test_the_diagnostics_show_each_arm(clock):
    bench = Bench("topics", clock=clock, scene=THREE, limits={"pressure": HIGHEST})
    bench.run(0.3)
    values = {status.name: status.values for status in bench.health.read()}["gate"]
    assert [values[f"limit {arm} [Pa]"] for arm in ARMS] == [120e3, 40e3, 90e3]
    with pytest.raises(BridgeError, match=r"expected one of .*'middle'"):
        bench.rig.set_fault("leak", "centre")


def test_gate_and_output_stage_hold_the_limits_of_each_arm(clock):
    gate, limiter = Gate(Mode.LIVE, LIMITS, clock), OutputLimiter(LIMITS, clock)
    gate.arm()
    for above in ([40.1e3], [100e3, 41e3, 60e3], [100e3, 30e3, 91e3], [-1.0, 0.0, 0.0]):
        with pytest.raises(BridgeError, match=r"0 ... 120000 \(left\), 40000 \(middle\), 90000 \(right\) Pa"):
            gate.command(above)
    gate.command([120e3, 40e3, 90e3])
    clock.pass_time(0.1)
    assert gate.tick() == pytest.approx((40e3, 10e3, 30e3))
    limiter.set_target((1e6, 1e6, 1e6), 1, clock())
    for _ in range(100):
        clock.pass_time(0.01)
        limiter.set_target((1e6, 1e6, 1e6), 1, clock())
        sent = limiter.next()
        assert all(value <= most for value, most in zip(sent, LIMITS.highest, strict=True))
    assert sent == (120e3, 40e3, 90e3)
    limiter.vent("test")
    clock.pass_time(0.5 * LIMITS.vent_ramp)
    assert limiter.next() == pytest.approx((60e3, 20e3, 45e3))
    clock.pass_time(0.5 * LIMITS.vent_ramp)
    assert limiter.next() == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def monitor_of(clock, sent, **reported):
    """Return the monitor of a rig that was sent set-points for a second and reported one value an arm [Pa]."""
    monitor = WriteMonitor(LIMITS, clock, resolution=100.0, reads_back=True, acknowledges=True)
    for _ in range(50):
        clock.pass_time(0.02)
        monitor.note_sent(sent)
        monitor.note_acknowledged()
        for note, values in ((monitor.note_read_back, sent), (monitor.note_measured, sent)):
            for arm, value in zip(ARMS, values, strict=True):
                given = reported.get(note.__name__, {}).get(arm, value)
                if given is not None:
                    note(arm, given, clock())
    return monitor


def test_each_arm_is_monitored_by_its_own_limit(clock):
    assert monitor_of(clock, ASKED).fault() == ""
    over = monitor_of(clock, ASKED, note_measured={"middle": 45e3})
    assert over.fault() == "middle measures 45.0 kPa, above the limit of 40.0 kPa"
    assert monitor_of(clock, ASKED, note_measured={"right": 45e3}).fault() == ""
    # 1 kPa is within the tolerance of the first arm, not of the second one.
    assert monitor_of(clock, ASKED, note_read_back={"left": 101e3}).fault() == ""
    assert "middle works to 31.0 kPa" in monitor_of(clock, ASKED, note_read_back={"middle": 31e3}).fault()
    assert "reports no set-points" in monitor_of(clock, ASKED, note_read_back={"right": None}).fault()


def test_zero_is_confirmed_only_when_all_arms_confirm(clock):
    zero = (0.0, 0.0, 0.0)
    assert monitor_of(clock, zero).zero_is_confirmed()
    for arm in ARMS:
        assert not monitor_of(clock, zero, note_read_back={arm: None}).zero_is_confirmed()
        assert not monitor_of(clock, zero, note_read_back={arm: 500.0}).zero_is_confirmed()
    assert monitor_of(clock, zero, note_measured={"middle": 3e3}).holding() == "middle holds 3.0 kPa"


@pytest.fixture
def serial_stage(clock):
    """Return a function that makes a rig on a serial line and an output stage for arms and limits, joined by hand."""
    ports = []

    def make(scene, limits):
        rig = MockRig(hidden_scene(load_scene(scene), Hidden()), clock=clock)
        port = SerialPort(rig)
        port.start()
        ports.append(port)
        device = SerialDevice(SerialSettings(port.name), limits.arms, clock)
        stage = OutputStage(device, limits, clock, commands=True)

        def run(duration, target=None):
            lines = []
            for _ in range(round(duration / 0.01)):
                if target is not None:
                    stage.set_target(list(target), 1, clock())
                stage.step()
                lines += [packet.data for packet in stage.exchange().packets if packet.sent]
                clock.pass_time(0.01)
                rig.advance()
                port.work()
            return lines

        return rig, stage, run

    yield make
    for port in ports:
        port.stop()


def test_three_pressures_arrive_over_a_serial_line_and_zero_is_confirmed(serial_stage):
    rig, stage, run = serial_stage(THREE, LIMITS)
    run(1.0, (200e3, 30e3, 60e3))
    assert rig.setpoint == pytest.approx((120e3, 30e3, 60e3), abs=1.0)
    status = stage.exchange().status
    assert (status.state, status.malformed, status.zero_confirmed) == ("active", 0, False)
    assert [stage.monitor.read_back[arm] for arm in ARMS] == pytest.approx([120e3, 30e3, 60e3], abs=1.0)
    stage.end("test", 5.0)
    run(0.5)
    assert stage.confirmed and rig.setpoint == (0.0, 0.0, 0.0)


def test_lines_of_two_arms_are_those_of_the_protocol_and_other_sizes_are_not_taken(serial_stage):
    rig, _, run = serial_stage(SMALL, Limits())
    lines = run(1.0, (80e3, 30e3))
    assert lines[0] == b"P 1 0.000 0.000*41\n"
    assert lines[-1] == b"P 100 800.000 300.000*4A\n"
    assert rig.setpoint == pytest.approx((80e3, 30e3), abs=1.0)
    _, other, run_other = serial_stage(THREE, Limits())
    run_other(0.3, (80e3, 30e3))
    status = other.exchange().status
    assert status.malformed > 10 and not other.monitor.read_back and status.refusals > 10


def file(links=None, **content):
    """Return the content of a rig file on Modbus."""
    link = {"type": "modbus", "host": "127.0.0.1"}
    return {"links": [{**link, **(links or {})}], **content}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            file(arms=list(ARMS), limits={"pressure": {"left": 1e5, "right": 1e5}}),
            "for each of .* @ limits.pressure",
        ),
        (file(limits={"pressure": HIGHEST}), r"got \['left', 'middle', 'right'\], .* \['left', 'right'\]"),
        (file(arms=["a"], limits={"slew": {"b": 1e5}}), r"got \['b'\], .* each of \['a'\] @ limits.slew"),
        (file(arms=["a"], limits={"pressure": {"a": "1"}}), "expected a number .* @ limits.pressure.a"),
        (file(arms=["a"], limits={"pressure": {"a": -1.0}}), "expected a number .* @ limits.pressure.a"),
        (file(limits={"vent_time": {"left": 1.0, "right": 1.0}}), "expected a number .* @ limits.vent_time"),
        (file(arms=["a", "a"]), r"'a' occurs twice; .* @ arms\[1\]"),
        (file(arms=["a", "b c"]), r"letters, digits and underscores @ arms\[1\]"),
        (file(arms=[]), "got 0 arms, expected 1 ... 16 @ arms"),
        (file(arms=[f"a{k}" for k in range(17)]), "got 17 arms, expected 1 ... 16 @ arms"),
        (file(arms="left"), "expected a list @ arms"),
        (file({"heartbeat": 2}, arms=list(ARMS)), "register 2 is setpoint's @ links.0..heartbeat"),
        (file({"clock": 2}, arms=list(ARMS)), "register 2 is actual's @ links.0..clock"),
        (file({"setpoint": 65534}, arms=list(ARMS)), "0 ... 65533 for 3 register"),
        (file({"unit": "Pa"}, arms=["a", "b"], limits={"pressure": {"a": 3e4, "b": 4e4}}), "40000 Pa for b"),
    ],
)
def test_a_rig_file_whose_arms_do_not_fit_is_refused_in_one_line(content, words):
    with pytest.raises(BridgeError, match=words) as refusal:
        load_rig(content)
    assert "\n" not in str(refusal.value)


def test_a_topic_of_an_arm_that_the_rig_file_does_not_name_is_refused():
    rule = {"topic": "/p", "type": "sensor_msgs/msg/FluidPressure", "gives": "pressure", "names": ["middle"]}
    link = {"type": "topics", "receive": [rule]}
    assert load_rig({"arms": list(ARMS), "links": [link]}).limits.arms == ARMS
    with pytest.raises(BridgeError, match=r"got \['middle'\], expected arms out of .*'left', 'right'"):
        load_rig({"links": [link]})


def test_a_bridge_whose_scene_has_other_arms_is_refused():
    for arms, scene in ((None, THREE), (["right", "middle", "left"], THREE), (list(ARMS), SMALL)):
        rig = load_rig(file(**({"arms": arms} if arms else {})))
        with pytest.raises(BridgeError, match=r"expected those of the scene .* @ arms of the rig file"):
            Bridge(load_scene(scene), rig, mode=Mode.SHADOW, clock=time.monotonic)


def test_hidden_parameters_hold_for_each_arm():
    hidden = hidden_scene(load_scene(THREE), Hidden(gain=0.5)).build().model.arms.each
    assert [own.pressure_gain for own in hidden] == pytest.approx([5e-7, 4e-7, 5e-7])
    assert {own.fill_time for own in hidden} == {0.001}


@pytest.mark.parametrize("scene", [SMALL, THREE])
def test_the_rigs_own_controllers_drive_each_arm_within_its_limit(clock, scene):
    for controller, distinct in (("wave", True), ("steps", False)):
        rig = MockRig(hidden_scene(load_scene(scene), Hidden()), clock=clock, controller=controller)
        assert rig.command([1e4] * len(rig.setpoint)) == "local control"
        clock.pass_time(0.5)
        rig.advance()
        assert len(rig.setpoint) == len(rig.pressure) == len(rig.simulation.arm_names)
        assert all(0.0 < value < LIMIT for value in rig.setpoint)
        assert len(set(rig.setpoint)) == (len(rig.setpoint) if distinct else 1)
    assert rig.command([1e4]) == "wrong size"

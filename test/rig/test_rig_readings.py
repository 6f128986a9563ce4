"""Units, clocks, checks and mappings of what a rig says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ldcs_ros.errors import BridgeError
from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.output import line_protocol
from ldcs_ros.rig.reading import RawReading
from ldcs_ros.rig.reading_validator import ReadingValidator
from ldcs_ros.rig.rig_file import load_rig, shipped_rigs
from ldcs_ros.rig.topic_link import Incoming, TopicLink
from ldcs_ros.rig.units import PASCALS, PressureUnit
from ldcs_ros.rig.valve_monitor import ValveMonitor


def pressure(value, stamp=None, received=1.0, name="left"):
    return RawReading("pressure", name, np.array(value), received, "rig", stamp)


@pytest.mark.parametrize("unit", PASCALS)
@pytest.mark.parametrize("reference", ["gauge", "absolute"])
def test_units_go_there_and_back(unit, reference):
    rule = PressureUnit(unit, reference)
    assert rule.to_pascal(rule.from_pascal(123456.0)) == pytest.approx(123456.0)


def test_units_are_what_rigs_mean():
    assert PressureUnit("mbar").to_pascal(1400.0) == 140e3
    assert PressureUnit("psi").to_pascal(20.0) == pytest.approx(137895.1, abs=0.1)
    assert PressureUnit("Pa", "absolute").to_pascal(101325.0) == 0.0


def test_offset_and_latency_of_a_clock_that_only_speaks():
    clock, generator = ClockEstimate(), np.random.default_rng(1)
    for k in range(400):
        stamp = 1000.0 + 0.01 * k
        clock.one_way(stamp, stamp - 900.0 + 0.002 + generator.exponential(0.004))
    assert clock.offset == pytest.approx(-900.0 + 0.002, abs=3e-4)
    assert 0.002 < clock.latency < 0.006
    assert clock.jumps == 0


def test_a_round_trip_tells_offset_and_latency_apart():
    clock, generator = ClockEstimate(), np.random.default_rng(1)
    for k in range(100):
        there, back = 0.005 + generator.exponential(0.003, 2)
        sent = 0.1 * k
        clock.round_trip(sent, sent + there + 500.0, sent + there + back)
    assert clock.offset == pytest.approx(-500.0, abs=1e-3)


@pytest.mark.parametrize("jump", [2.0, -2.0])
def test_a_clock_jump_is_noticed_and_learnt(jump):
    clock = ClockEstimate()
    for k in range(50):
        clock.one_way(0.01 * k, 0.01 * k + 5.0)
    for k in range(50, 60):
        clock.one_way(0.01 * k + jump, 0.01 * k + 5.0)
    assert clock.jumps == 1
    assert clock.last_jump == pytest.approx(jump, abs=0.02)
    assert clock.offset == pytest.approx(5.0 - jump)


def test_a_late_message_is_no_clock_jump():
    clock = ClockEstimate()
    for k in range(50):
        clock.one_way(0.01 * k, 0.01 * k + 5.0 + (0.8 if k == 30 else 0.0))
    assert clock.jumps == 0
    assert clock.worst_latency == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("value", "reason"),
    [(float("nan"), "not a number"), (float("inf"), "not a number"), (9e6, "implausible")],
)
def test_nonsense_is_dropped_and_counted(value, reason):
    validator = ReadingValidator(5e5, 0.0)
    assert validator.validate(pressure(value)) is None
    assert validator.dropped == {reason: 1} and reason in validator.last_drop


@pytest.mark.parametrize(
    ("place", "sound"),
    [([0.1, 0.0, 0.05], True), ([0.0, -2.0, 0.0], True), ([0.0, -2.01, 0.0], False), ([0.1, 0.0], False)],
)
def test_a_position_has_three_numbers_within_two_metres(place, sound):
    validator = ReadingValidator(5e5, 0.0)
    found = validator.validate(RawReading("position", "P1", np.array(place), 1.0, "rig", None))
    assert (found is not None) is sound
    assert validator.dropped == ({} if sound else {"implausible": 1})


@pytest.mark.parametrize(("gauge", "sound"), [(-50e3, True), (-50.1e3, False), (0.0, True)])
def test_no_chamber_is_deeper_than_half_a_vacuum(gauge, sound):
    assert (ReadingValidator(5e5, 0.0).validate(pressure(gauge)) is not None) is sound


def test_copies_and_late_comers_are_dropped():
    validator = ReadingValidator(5e5, 0.0)
    taken = [
        validator.validate(pressure(1e4, stamp, 1.0 + stamp)) for stamp in (0.0, 0.01, 0.01, 0.03, 0.02, 0.04)
    ]
    assert [sample is not None for sample in taken] == [True, True, False, True, False, True]
    assert validator.dropped == {"duplicate": 1, "out of order": 1}


@pytest.mark.parametrize("jump", [2.0, -2.0])
def test_readings_stay_fresh_through_a_clock_jump(jump):
    validator = ReadingValidator(5e5, 0.0)
    for k in range(100):
        now = 0.01 * k
        validator.validate(pressure(1e4, now + (jump if k >= 50 else 0.0), now + 0.001))
        assert validator.silence(now + 0.001, "pressure") < 0.03
    assert validator.dropped.total() <= 1


def test_silence_is_that_of_the_quietest_arm():
    validator = ReadingValidator(5e5, 0.0)
    validator.validate(pressure(1e4, None, 1.0, "left"))
    validator.validate(pressure(1e4, None, 2.0, "right"))
    assert validator.silence(3.0, "pressure") == 2.0


def test_a_stuck_valve_and_a_leak_are_told_apart():
    watch = ValveMonitor(tolerance={"left": 10e3, "right": 10e3}, patience=0.4)
    for k in range(80):
        time = 0.01 * k
        watch.take("left", time, 20e3, 20e3 + 60e3 * min(time, 1.0))
        watch.take("right", time, 50e3 - 20e3 * time, 80e3)
    assert "does not move: stuck valve?" in watch.faults["left"]
    assert "leak" in watch.faults["right"]
    watch.take("right", 0.8, 79e3, 80e3)
    assert "right" not in watch.faults


def topic_link(clock, **rule):
    return TopicLink((Incoming(**rule),), clock)


def test_ros_types_give_readings_in_si(clock):
    mbar = PressureUnit("mbar")
    link = topic_link(
        clock,
        topic="/p",
        type="std_msgs/msg/Float64MultiArray",
        gives="pressure",
        names={"0": "left", "1": "right"},
        unit=mbar,
    )
    link.receive("/p", messages.pressure_command(np.array([100.0, 200.0])))
    assert [(r.name, float(r.value)) for r in link.take_readings()] == [("left", 1e4), ("right", 2e4)]
    link = topic_link(
        clock,
        topic="/j",
        type="sensor_msgs/msg/JointState",
        gives="pressure_command",
        names={"valve_2": "left"},
        unit=mbar,
        field="position",
    )
    names, values = ["valve_1", "valve_2"], np.array([1.0, 300.0])
    link.receive("/j", messages.joint_states(5 * 10**9, names, values, values, values))
    (reading,) = link.take_readings()
    assert (reading.name, float(reading.value), reading.stamp) == ("left", 3e4, 5.0)


def test_a_tracker_is_turned_into_the_frame_of_the_sheet(clock):
    link = topic_link(
        clock,
        topic="/t",
        type="geometry_msgs/msg/TransformStamped",
        gives="position",
        names={"trakstar1": "P1"},
        origin=(0.1, 0.0, 0.0),
        turn=(0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)),
        age=0.02,
    )
    stamped = messages.transform(10**9, "trakstar_base", "trakstar1", np.array([0.2, 0.0, 0.0]), np.eye(4)[3])
    link.receive("/t", encode(stamped))
    (reading,) = link.take_readings()
    assert np.allclose(reading.value, [0.1, 0.2, 0.0]) and reading.age == 0.02
    assert [(frame.link, frame.type) for frame in link.take_packets()] == [("/t", stamped.__msgtype__)]


def test_bytes_that_make_no_sense_are_counted(clock):
    link = topic_link(
        clock, topic="/p", type="std_msgs/msg/Float64MultiArray", gives="pressure", names={"0": "left"}
    )
    link.receive("/p", b"\x00\x01\x00\x00")
    head = message_class("std_msgs/msg/Header")
    link.receive("/p", encode(head(stamp=header(0, "").stamp, frame_id="x")))
    assert link.malformed == 2 and not link.take_readings()


@given(st.lists(st.binary(max_size=40), max_size=20))
def test_a_line_survives_any_cut_of_the_stream(noise):
    whole = line_protocol.line("S", 7, 1234, 1.0, 2.0, 3.0, 4.0)
    buffer = line_protocol.LineBuffer()
    lines = []
    for piece in (whole[:5], whole[5:], *noise, b"\n", whole):
        lines += buffer.feed(piece)
    good = 0
    for raw in lines:
        try:
            good += line_protocol.fields(raw)[0] == "S"
        except (ValueError, IndexError):
            pass
    assert good >= 2


def test_a_flipped_bit_spoils_a_line():
    whole = bytearray(line_protocol.line("P", 1, 100.0, 100.0))
    whole[5] ^= 1
    with pytest.raises(ValueError):
        line_protocol.fields(bytes(whole).strip())


@pytest.mark.parametrize("name", shipped_rigs())
def test_shipped_rig_files_load(name):
    rig = load_rig(name)
    assert rig.title and rig.limits.pressure <= 140e3 and rig.links


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"limits": {"pressure": -1.0}}, "expected a number 1 ... 1e+07 @ limits.pressure"),
        ({"limits": {"presure": 1.0}}, "unknown key 'presure'"),
        ({"limits": {"vent_time": 0.1}}, "expected at least vent_ramp"),
        ({"links": []}, "no link leads to the rig"),
        ({"links": [{"type": "can"}]}, "expected one of ['modbus', 'serial', 'topics'] @ links[0].type"),
        ({"links": [{"type": "modbus"}]}, "missing key 'host' @ links[0]"),
        ({"links": [{"type": "serial", "port": "/dev/x", "unit": "atm"}]}, "unknown unit 'atm'"),
        (
            {"links": [{"type": "serial", "port": "/dev/x"}, {"type": "modbus", "host": "h"}]},
            "more than one link",
        ),
    ],
)
def test_a_bad_rig_file_is_one_clear_line(change, words):
    good = {"links": [{"type": "serial", "port": "/dev/ttyUSB0"}]}
    with pytest.raises(BridgeError) as caught:
        load_rig({**good, **change})
    assert words in str(caught.value) and "\n" not in str(caught.value)

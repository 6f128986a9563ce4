"""A rig's bag becomes signals in SI units and ldcs_base: units, axes, clocks, gaps and copies."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.signals import MappingError
from ldcs_ros.signals.channels import ChannelReport, read_channel
from ldcs_ros.signals.fields import at_path, default_offset, numbers, parts, position, stamp
from ldcs_ros.signals.mapping import parse_mapping
from ldcs_ros.signals.signals import read_signals

sys.path.insert(0, str(Path(__file__).parents[1] / "replay"))
import rig_bag
from rig_bag import WALL

MS = 1_000_000  # ns


def joints(time, names, angles):
    kind = "sensor_msgs/msg/JointState"
    angles = np.asarray(angles, dtype=float)
    return rig_bag.build(
        kind,
        header=rig_bag.header(time),
        name=names,
        position=angles,
        velocity=0.0 * angles,
        effort=10.0 * angles,
    )


def bag(folder, *messages):
    return read_bag(rig_bag.write(folder / "rig", [("/note", WALL, rig_bag.array([0.0])), *messages]))


def signals(recording, *measurements, **keys):
    mapping = parse_mapping({"measurements": list(measurements), **keys})
    return read_signals(recording, name="rig", mapping=mapping, measured=True)


def test_a_tracker_turned_a_quarter_about_z_is_turned_back_scaled_and_moved(tmp_path):
    # (x, y, z) of the tracker lies at (-y, x, z) in ldcs_base, 10, 20 and 30 mm from its origin.
    message = rig_bag.transform(WALL + 250 * MS, "probe", [100.0, 20.0, -5.0])
    half = float(np.sqrt(0.5))
    source = {"topic": "/tracker", "to": "P1", "unit": "mm", "translation": [0.01, 0.02, 0.03],
              "rotation": [0.0, 0.0, half, half]}  # fmt: skip
    found = signals(bag(tmp_path, ("/tracker", WALL + 251 * MS, message)), source)
    series = found.series["P1"]
    np.testing.assert_allclose(series.value, [[0.01 - 0.020, 0.02 + 0.100, 0.03 - 0.005]], atol=1e-12)
    assert series.time == pytest.approx([0.25]) and series.unit == "m" and series.axes == ("x", "y", "z")
    assert not series.smooth and not found.in_simulation_time and found.surface is None


def test_of_two_probes_in_a_topic_each_point_gets_its_own(tmp_path):
    messages = [
        ("/tracker", WALL + k * MS, rig_bag.transform(WALL + k * MS, f"probe{k % 2}", [k, 0.0, 0.0]))
        for k in range(1, 9)
    ]
    sources = [{"topic": "/tracker", "to": f"P{n}", "child": f"probe{n}"} for n in (0, 1)]
    found = signals(bag(tmp_path, *messages), *sources)
    assert found.series["P0"].value[:, 0].tolist() == [2.0, 4.0, 6.0, 8.0]
    assert found.series["P1"].value[:, 0].tolist() == [1.0, 3.0, 5.0, 7.0]


def test_fluid_pressure_is_absolute_and_a_mapping_may_say_gauge(tmp_path):
    recording = bag(tmp_path, ("/left", WALL + MS, rig_bag.fluid(WALL + MS, 151_325.0)))
    gauge = signals(recording, {"topic": "/left", "to": "left/pressure"})
    assert gauge.series["left/pressure"].value == pytest.approx(50_000.0)
    assert gauge.series["left/pressure"].unit == "Pa"
    thin = signals(recording, {"topic": "/left", "to": "left/pressure"}, ambient_pressure=95_000.0)
    assert thin.series["left/pressure"].value == pytest.approx(56_325.0)
    own = signals(recording, {"topic": "/left", "to": "left/pressure", "absolute": False})
    assert own.series["left/pressure"].value == pytest.approx(151_325.0)
    assert default_offset("std_msgs/msg/Float64MultiArray") == 0.0


def test_a_number_of_many_is_chosen_by_index_or_by_the_joints_name(tmp_path):
    recording = bag(
        tmp_path,
        ("/valves", WALL + MS, rig_bag.array([1.0, 2.0, 4.0])),
        ("/joints", WALL + MS, joints(WALL + MS, ["left_joint_1", "left_joint_2"], [0.1, 0.4])),
    )
    by_index = signals(recording, {"topic": "/valves", "to": "left/pressure", "index": 2, "unit": "mbar"})
    assert by_index.series["left/pressure"].value == pytest.approx(400.0)
    by_name = signals(recording, {"topic": "/joints", "to": "joint/left_joint_2", "unit": "deg"})
    series = by_name.series["joint/left_joint_2"]
    assert (
        series.value == pytest.approx(0.4 * np.pi / 180.0) and series.unit == "rad" and series.axes == ("",)
    )
    both = {"topic": "/joints", "to": "P0"}
    good = {"topic": "/valves", "to": "left/pressure", "index": 0}
    for source, words in (
        ({"topic": "/valves", "to": "right/pressure"}, "has 3 values; name with 'index:'"),
        ({"topic": "/valves", "to": "right/pressure", "index": 3}, "there is no index 3"),
        ({**both, "field": "position"}, "holds 2 numbers, expected x, y, z"),
    ):
        found = signals(recording, good, source)
        assert source["to"] not in found.series
        assert any(words in warning for warning in found.warnings), found.warnings


def test_times_are_stamps_on_the_recorders_clock_and_oddities_are_counted(tmp_path):
    # A clock an hour ahead; 10 ms period; one copy, one message swapped, one 0.3 s late, one gap of 100 ms.
    hour = 3_600_000 * MS
    ticks = [10, 20, 20, 40, 30, 50, 150, 160, 170, 180, 190, 200, 210, 220]
    late = {160: 300}
    messages = []
    for tick in ticks:
        message = rig_bag.fluid(WALL + hour + tick * MS, 1000.0 + tick)
        messages.append(("/left", WALL + (tick + late.get(tick, 2)) * MS, message))
    messages.sort(key=lambda each: each[1])
    report = ChannelReport("/left")
    found = read_channel(bag(tmp_path, *messages), "/left", report, by="stamp", late=0.1, gap=None)
    expected = sorted(ticks)
    assert [one.time for one in found] == [WALL + (tick + 2) * MS for tick in expected]
    assert [one.message.fluid_pressure for one in found] == [1000.0 + tick for tick in expected]
    assert (report.messages, report.repeated, report.late) == (14, 1, 1)
    assert report.missing == 9 and report.longest_gap == pytest.approx(0.1)
    assert report.clock_offset == pytest.approx(3600.0 - 0.002, abs=1e-6)
    text = " ".join(report.warnings())
    assert "1 with stamp and content of an earlier one" in text
    assert "9 missing (a silence of 0.1 s at 0.052 s)" in text
    counted = ChannelReport("/left")
    by_log = read_channel(bag(tmp_path / "again", *messages), "/left", counted, by="log", late=0.1, gap=0.35)
    assert [one.time for one in by_log] == [time for _, time, _ in messages]
    assert counted.missing == 0


def test_a_topic_that_is_not_there_is_named_with_the_ones_that_are(tmp_path):
    with pytest.raises(MappingError, match=r"has no topic '/other', only \['/note'\]"):
        signals(bag(tmp_path), {"topic": "/other", "to": "P0"})


def test_fields_follow_their_dots_and_name_what_is_missing():
    message = rig_bag.transform(WALL, "probe", [1.0, 2.0, 3.0])
    kind = message.__msgtype__
    assert at_path(message, "transform.translation.y") == 2.0
    assert at_path(message, "") is message
    assert stamp(message) == WALL
    assert stamp(rig_bag.array([1.0])) is None and stamp(rig_bag.fluid(0, 1.0)) is None
    assert position(message, "", kind).tolist() == [1.0, 2.0, 3.0]
    assert [parts(message, child) for child in ("probe", "other", "")] == [[message], [], [message]]
    with pytest.raises(MappingError, match="scale"):
        at_path(message, "transform.scale")
    with pytest.raises(MappingError, match="no usual field"):
        position(rig_bag.array([1.0, 2.0, 3.0]), "", "std_msgs/msg/Float64MultiArray")
    values = rig_bag.array([5.0, 6.0])
    assert numbers(values, "", values.__msgtype__).tolist() == [5.0, 6.0]
    # A type without a usual field needs the name of one.
    assert numbers(values, "data", "some_rig/msg/Valves").tolist() == [5.0, 6.0]
    with pytest.raises(MappingError, match="some_rig/msg/Valves has no usual field"):
        numbers(values, "", "some_rig/msg/Valves")


def test_a_new_report_counts_from_zero_and_each_bad_value_once(tmp_path):
    report = ChannelReport("/left")
    counts = {name: value for name, value in report.as_dict().items() if isinstance(value, int)}
    assert counts and not any(counts.values()) and report.warnings() == []
    recording = bag(
        tmp_path,
        *(("/valves", WALL + k * MS, rig_bag.array([1.0] * (1 + k % 2))) for k in range(1, 6)),
    )
    found = signals(recording, {"topic": "/valves", "to": "left/pressure"})
    # Of five messages the three with two values are malformed; the others go on.
    assert len(found.series["left/pressure"].time) == 2
    assert any("3 malformed" in warning for warning in found.warnings), found.warnings


def test_only_fluid_pressure_is_absolute_by_its_type():
    for kind in ("geometry_msgs/msg/PointStamped", "sensor_msgs/msg/Temperature", "a", "z"):
        assert default_offset(kind, 9e4) == 0.0
    assert default_offset("sensor_msgs/msg/FluidPressure", 9e4) == 9e4


def test_bytes_that_are_no_message_are_counted_and_the_others_go_on(tmp_path):
    kind = "sensor_msgs/msg/FluidPressure"
    good = [("/left", WALL + k * 10 * MS, rig_bag.fluid(WALL + k * 10 * MS, 100.0 + k)) for k in range(1, 7)]
    messages = [*good[:3], ("/left", WALL + 35 * MS, (kind, b"\x00\x01\x00\x00\x07")), *good[3:]]
    report = ChannelReport("/left")
    found = read_channel(bag(tmp_path, *messages), "/left", report, by="stamp", late=0.1, gap=None)
    assert [one.message.fluid_pressure for one in found] == [101.0, 102.0, 103.0, 104.0, 105.0, 106.0]
    assert (report.messages, report.malformed) == (7, 1)
    text = " ".join(report.warnings())
    assert "1 malformed" in text and "clock" not in text


def test_a_topic_may_measure_one_coordinate(tmp_path):
    sent = []
    for k in range(3):
        time = WALL + 100 * k * MS
        sent.append(("/laser", time, rig_bag.build("std_msgs/msg/Float64", data=380.0 + k)))
        sent.append(("/t", time, rig_bag.transform(time, "probe", (1.0, 2.0, 3.0 + k))))
    down = {
        "topic": "/laser",
        "to": "P1.z",
        "unit": "mm",
        "translation": [0, 0, 0.4],
        "rotation": [1, 0, 0, 0],
    }
    side = {"topic": "/t", "to": "P0.x", "unit": "mm", "field": "transform.translation.z"}
    recording = read_bag(rig_bag.write(tmp_path / "bag", sent))
    mapping = parse_mapping({"measurements": [down, side]})
    found = read_signals(recording, name="rig", mapping=mapping, measured=True).series
    np.testing.assert_allclose(found["P1.z"].value[:, 0], [0.020, 0.019, 0.018], atol=1e-12)
    np.testing.assert_allclose(found["P0.x"].value[:, 0], [0.003, 0.004, 0.005], atol=1e-12)

"""A tolerance file is understood or refused whole, and a broken limit is seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rig_bag

from ldcs_ros.bags import read_bag
from ldcs_ros.compare.comparison import Options, compare
from ldcs_ros.compare.difference import ErrorStatistics
from ldcs_ros.compare.report import summary
from ldcs_ros.compare.tolerances import ToleranceError, check, load_tolerances
from ldcs_ros.errors import RecordingError
from ldcs_ros.signals.mapping import parse_mapping

FOUND = ErrorStatistics(rms=0.001, p95=0.002, max=0.003, mean=-0.0005, end=-0.0008, normalised_rms=0.01)
COMPARED = [
    ("P1", FOUND, "m"),
    ("P1.z", FOUND, "m"),
    ("left/pressure", ErrorStatistics(10.0, 20.0, 30.0, 1.0, 1.0), "Pa"),
]


def load(tmp_path, text):
    (tmp_path / "limits.yaml").write_text(text)
    return load_tolerances(tmp_path / "limits.yaml")


def test_a_limit_is_kept_up_to_its_value(tmp_path):
    limits = load(
        tmp_path, 'P1: {max: 0.003, rms: 0.0009}\n"*.z": {mean: 0.0004, end: 1}\n"*/pressure": {p95: 20}\n'
    )
    kept = {(one.channel, one.figure): one.passed for one in check(limits, COMPARED)}
    assert kept == {
        ("P1", "max"): True,
        ("P1", "rms"): False,
        ("P1.z", "mean"): False,
        ("P1.z", "end"): True,
        ("left/pressure", "p95"): True,
    }


def test_a_pattern_without_a_dot_does_not_mean_the_axes(tmp_path):
    assert [one.channel for one in check(load(tmp_path, "P*: {max: 1}"), COMPARED)] == ["P1"]


def test_a_figure_that_is_no_number_breaks_its_limit():
    lost = ErrorStatistics(math.nan, math.nan, math.nan, math.nan, math.nan)
    checks = check({"P1": {"rms": 1.0, "normalised_rms": 1.0}}, [("P1", lost, "m")])
    assert not any(one.passed for one in checks)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "holds no limits"),
        ("P1: 3", "expected a mapping with keys out of"),
        ("P1: {most: 1}", "unknown key 'most'"),
        ("P1: {max: '1e-3'}", "without quotes"),
        ("P1: {max: -1}", "at least 0"),
        ("P1: {max: .nan}", "finite number"),
        ("P1: [", "not valid YAML"),
        ("P9: {max: 1}", "fits no channel"),
    ],
)
def test_a_tolerance_file_that_checks_nothing_is_refused(tmp_path, text, reason):
    with pytest.raises(ToleranceError, match=reason):
        check(load(tmp_path, text), COMPARED)


def test_a_tolerance_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ToleranceError, match="No such file"):
        load_tolerances(tmp_path / "none.yaml")


def pose_bag(folder, times, *, stamps=None, lift=0.0, transforms=()):
    """Write positions that swing with 0.7 Hz, as poses of P1 or as transforms (child, stamp behind, lift)."""
    messages = []
    for k, time in enumerate(times):
        log = rig_bag.WALL + round(time * 1e9)
        height = 0.02 * math.sin(4.4 * time) + 0.01 * math.sin(1.9 * time * time) + lift
        if transforms:
            parts = [
                rig_bag.transform(log - round(behind * 1e9), child, (0.1, 0.0, height + extra))
                for child, behind, extra in transforms
            ]
            messages.append(("/tf", log, rig_bag.build("tf2_msgs/msg/TFMessage", transforms=parts)))
        else:
            stamp = log if stamps is None else stamps[k]
            place = rig_bag.build("geometry_msgs/msg/Point", x=0.1, y=0.0, z=height)
            message = rig_bag.build(
                "geometry_msgs/msg/PointStamped", header=rig_bag.header(stamp), point=place
            )
            messages.append(("/P1", log, message))
    return read_bag(rig_bag.write(folder, messages))


POINT = parse_mapping({"measurements": [{"topic": "/P1", "to": "P1"}]})
TIP = parse_mapping({"measurements": [{"topic": "/tf", "to": "P1", "child": "tip"}]})
TIMES = np.arange(0.0, 3.0, 0.02)


def compared(a, b, mapping_b, limits=None):
    return compare(
        a, b, Options(mappings=(POINT, mapping_b), offset=0.0, tolerances=limits or {"P1": {"rms": 1e-3}})
    )


def test_each_transform_of_a_message_has_the_stamp_of_its_own(tmp_path):
    a = pose_bag(tmp_path / "a", TIMES)
    transforms = [("base", 300.0, 0.0), ("tip", 0.0, 0.02)]
    found = compared(a, pose_bag(tmp_path / "b", TIMES, transforms=transforms), TIP)
    assert len(found.channels["P1"].time) == len(TIMES)
    assert found.channels["P1"].overall.rms == pytest.approx(0.02, rel=1e-3) and not found.passed
    assert compared(
        a, pose_bag(tmp_path / "c", TIMES, transforms=[transforms[0], ("tip", 0.0, 0.0)]), TIP
    ).passed


@pytest.mark.parametrize(
    ("count", "words"), [(6, "6 samples over 3 %"), (75, "75 samples over 50 %"), (2, "2 samples")]
)
def test_a_channel_that_ends_early_keeps_no_limit(tmp_path, count, words):
    a = pose_bag(tmp_path / "a", TIMES)
    short = rig_bag.write(
        tmp_path / "b",
        [
            *(
                ("/P1", message.time, (message.type, message.cdr))
                for message in list(pose_bag(tmp_path / "whole", TIMES).in_order())[:count]
            ),
            *(
                ("/P0", rig_bag.WALL + round(time * 1e9), rig_bag.transform(1, "", (0, 0, 0)))
                for time in TIMES
            ),
        ],
    )
    both = parse_mapping({"measurements": [{"topic": "/P1", "to": "P1"}, {"topic": "/P0", "to": "P0"}]})
    whole = rig_bag.write(
        tmp_path / "c",
        [
            *(("/P1", message.time, (message.type, message.cdr)) for message in a.in_order()),
            *(
                ("/P0", rig_bag.WALL + round(time * 1e9), rig_bag.transform(1, "", (0, 0, 0)))
                for time in TIMES
            ),
        ],
    )
    options = Options(mappings=(both, both), offset=0.0, tolerances={"P1": {"rms": 1e-3}})
    found = compare(read_bag(whole), read_bag(short), options)
    assert found.channels["P1"].overall.rms < 1e-6 and not found.passed
    assert words in dict(summary(found))["FAILED"]


def test_time_log_leaves_stamps_alone(tmp_path):
    a = pose_bag(tmp_path / "a", TIMES)
    stamps = [rig_bag.WALL + round((time - 3600.0 * (time > 1.5)) * 1e9) for time in TIMES]
    b = pose_bag(tmp_path / "b", TIMES, stamps=stamps)
    by_log = parse_mapping({"time": "log", "measurements": [{"topic": "/P1", "to": "P1"}]})
    for mapping in (by_log, POINT):
        found = compared(a, b, mapping)
        assert found.passed and found.channels["P1"].overall.rms < 1e-6
    assert not any("clock" in warning for warning in compared(a, b, by_log).b.warnings)
    assert any("set 1 time(s) (-3600.000 s)" in warning for warning in compared(a, b, POINT).b.warnings)


def test_a_first_log_time_of_zero_is_refused_with_both_times(tmp_path):
    a = pose_bag(tmp_path / "a", TIMES)
    (first, *rest) = list(a.in_order())
    messages = [(m.topic, m.time, (m.type, m.cdr)) for m in (first, *rest)]
    mixed = read_bag(rig_bag.write(tmp_path / "b", [("/P1", 0, (first.type, first.cdr)), *messages]))
    with pytest.raises(RecordingError, match=r"from 0\.000 s to 1790000002\.980 s after 1970"):
        compared(a, mixed, POINT)

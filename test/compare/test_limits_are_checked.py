"""A tolerance file is understood or refused whole, and a broken limit is seen."""

from __future__ import annotations

import math

import pytest

from ldcs_ros.compare.difference import ErrorStatistics
from ldcs_ros.compare.tolerances import ToleranceError, check, load_tolerances

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

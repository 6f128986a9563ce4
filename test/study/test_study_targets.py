"""Targets, scaling and orders follow from the rows."""

from __future__ import annotations

import math

import pytest

from ldcs_ros.study import report, scaling
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.targets import Target, targets
from ldcs_ros.study.tasks import perform


def curve(method, error, cpu, *, scene="arc", nodes=9, setting="accuracy", value=0.0, failure=""):
    value = value or error
    return Row("curve", scene, nodes, method, setting, value, error=error, cpu=cpu, steps=9, failure=failure)


def grown(nodes, cpu, peak=500, failure=""):
    extra = f"peak {peak}"
    return Row(
        "scaling", "arc_material", nodes, "esdirk43", "accuracy", 1e-5, cpu=cpu, extra=extra, failure=failure
    )


def rated(rate, cpu, error=1e-6, method="esdirk43"):
    return Row("rate", "paper", 9, method, "rate", rate, error=error, cpu=cpu, steps=4)


def found(rows, words):
    (target,) = [target for target in targets(rows) if words in target.name]
    return target


def test_a_speed_is_met_missed_or_not_measured():
    rows = [curve("esdirk43", 1e-6, 0.005), curve("compiled_rkc2", 1e-6, 0.02), curve("scipy_BDF", 5e-5, 0.1)]
    fast = found(rows, "`arc` 9 x 9, error <= 1e-05")
    assert fast.met and fast.verdict == "met" and "200 x" in fast.reached
    assert fast.others == "compiled RKC2: 4.0 times ours; SciPy BDF: 20.0 times ours, error 5.0e-05 m"
    assert found(rows, "`arc` 33 x 33").verdict == "-"
    slow = found([curve("esdirk43", 1e-5, 2.0, nodes=65)], "65 x 65")
    assert slow.met is False and slow.verdict == "MISSED"


def test_a_run_that_failed_misses_its_target_with_the_reason():
    rows = [curve("esdirk43", math.nan, math.nan, nodes=65, failure="too slow: 9 CPU s per simulated second")]
    assert found(rows, "65 x 65") == Target(
        "`arc` 65 x 65, error <= 2e-05 m", ">= 1 x real time", rows[0].failure, False
    )


def test_scaling_counts_from_end_to_end_and_by_least_squares():
    rows = [grown(n, 1e-4 * float(n) ** 2.4) for n in (17, 33, 65, 129)]
    assert scaling.exponents(rows) == pytest.approx((1.2, 1.2))
    assert found(rows, "nodes to the power").met
    assert found(rows, "peak memory").met
    assert found([*rows[:-1], grown(129, 9e3, peak=2100)], "peak memory").met is False
    steep = found([grown(n, 1e-4 * n**3) for n in (17, 129)], "nodes to the power")
    assert steep.met is False and "1.50" in steep.reached
    part = found(rows[:2], "nodes to the power")
    assert part.met is None and "only 17 to 33" in part.reached
    assert found([grown(129, 1.0, failure="no memory")], "peak memory").met is False


def test_commands_are_judged_by_the_smooth_case_and_by_their_error():
    rows = [rated(0.0, 0.01), rated(100.0, 0.019), rated(1000.0, 0.5), rated(100.0, 0.19, method="scipy_BDF")]
    hundred = found(rows, "commands at 100 Hz")
    assert (
        hundred.met and "0.53 of smooth" in hundred.reached and "SciPy BDF: 10 times ours" in hundred.others
    )
    assert found(rows, "commands at 1000 Hz").verdict == "-"
    assert found([rated(0.0, 0.01), rated(100.0, 0.021)], "100 Hz").met is False
    assert found([rated(0.0, 0.01), rated(100.0, 0.01, error=2e-5)], "100 Hz").met is False


def test_a_failed_run_counts_against_the_accuracy():
    good = [
        Row("accuracy", "arc", 9, "esdirk43", "accuracy", 1e-5, error=4e-6, cpu=0.1),
        Row("accuracy", "rig", 9, "esdirk43", "accuracy", 1e-5, error=5e-6, cpu=0.1),
    ]
    assert found(good, "within the asked").met and found(good, "largest real error").reached == "0.50"
    lost = [*good, Row("accuracy", "paper", 0, "auto", "accuracy", 0.0, failure="diverged")]
    assert found(lost, "within the asked").met is False and found(lost, "largest real error").met is False


def test_orders_come_from_the_errors_at_fixed_steps():
    rows = [
        curve("trbdf2", 1e-4 * (h / 0.02) ** 2, 0.1, setting="dt", value=h) for h in (0.005, 0.02, 0.01)
    ] + [curve("rosenbrock_w", 1e-5 * (h / 0.01) ** 2.3, 0.1, setting="dt", value=h) for h in (0.01, 0.005)]
    assert [pair[:2] for pair in report.convergence_orders(rows)["trbdf2"]] == [(0.02, 0.01), (0.01, 0.005)]
    assert report.mean_order(report.convergence_orders(rows)["trbdf2"]) == pytest.approx(2.0)
    table = report.report(rows, machine={}, commands=["ldcs study"], picture="")
    assert "| `trbdf2` | 2 | 2.0 |" in table and "| `rosenbrock_w` | 3 | **2.3** |" in table


def test_a_size_is_measured_in_a_process_of_its_own(monkeypatch):
    (row,) = perform(Task("scaling", "arc_material", 5, "esdirk43", "accuracy", 1e-4, 1))
    assert row.failure == "" and row.steps > 3 and 0.0 < row.cpu < 60.0
    assert 50.0 < scaling.peak_memory(row) < 2000.0
    monkeypatch.setattr(scaling.sys, "executable", "/bin/false")
    (row,) = perform(Task("scaling", "arc_material", 5, "esdirk43", "accuracy", 1e-4, 1))
    assert "5 x 5 nodes ended with 1" in row.failure

"""Targets, scaling and orders follow from the rows."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from ldcs_ros.study import paired_runs, report, scaling
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


def pushed(method, cpu):
    return Row("rate", "arc_pushed", 9, method, "rate", 100.0, error=1e-6, cpu=cpu, steps=4)


def found(rows, words):
    exact = [target for target in targets(rows) if target.name == words]
    (target,) = exact or [target for target in targets(rows) if words in target.name]
    return target


def test_a_speed_is_met_missed_or_not_measured():
    rows = [curve("esdirk43", 1e-6, 0.005), curve("compiled_rkc2", 1e-6, 0.02), curve("scipy_BDF", 5e-5, 0.1)]
    fast = found(rows, "`arc` 9 x 9, error <= 1e-05 m")
    assert fast.met and fast.verdict == "met" and "200 x" in fast.reached
    assert fast.others == "compiled RKC2: 4.0 times ours; SciPy BDF: 20.0 times ours, error 5.0e-05 m"
    assert found(rows, "`arc` 33 x 33, error <= 2e-05 m").verdict == "-"
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
    hundred = found(rows, "commands at 100 Hz, 1e-05 m")
    assert (
        hundred.met and "0.53 of smooth" in hundred.reached and "SciPy BDF: 10 times ours" in hundred.others
    )
    assert found(rows, "commands at 1000 Hz, 1e-05 m").verdict == "-"
    assert found([rated(0.0, 0.01), rated(100.0, 0.021)], "100 Hz, 1e-05 m").met is False
    assert found([rated(0.0, 0.01), rated(100.0, 0.01, error=2e-5)], "100 Hz, 1e-05 m").met is False


def test_a_target_against_another_solver_is_a_ratio_of_one_run():
    rows = [curve("esdirk43", 1e-6, 0.005), curve("compiled_rkc2", 1e-6, 0.02), curve("trbdf2", 1e-6, 0.1)]
    against = "`arc` 9 x 9, error <= 1e-05 m, against compiled RKC2"
    assert found(rows, against) == Target(against, ">= 3 times as fast", "4.00 times", True)
    assert found([*rows, curve("compiled_rkc2", 9e-6, 0.01, value=0.1)], against).met is False
    assert found(rows[:1], against).met is None
    ours = [pushed("esdirk43", 0.01), Row(**{**vars(pushed("esdirk43", 0.01)), "value": 0.0})]
    target = found([*ours, pushed("compiled_rkc2", 0.011)], "100 Hz, 1e-05 m, against")
    assert target.met is False and target.reached == "1.10 times"


def test_a_pair_is_met_by_its_ratio_and_its_error():
    def pair(cpu, error=4e-6):
        return Row("paired", "rig", 9, "auto", "noisy", 100.0, error=error, cpu=cpu, extra="other 0.4")

    words = "`rig`, noisy commands at 100 Hz"
    assert found([], words).verdict == "-"
    assert found([pair(0.1)], words).met and found([pair(0.1)], words).reached.startswith("4.00 times")
    assert found([pair(0.11)], words).met is False
    assert found([pair(0.05, error=1.2e-5)], words).met is False


@pytest.mark.slow
def test_a_checkout_beside_itself_is_about_as_fast(monkeypatch):
    monkeypatch.setattr(paired_runs, "SPAN", 0.1)
    checkout = str(Path(__file__).resolve().parents[2])
    (row,) = perform(Task("paired", "paper", 9, "auto", "smooth", 100.0, 2, checkout=checkout))
    assert row.failure == "" and 0.0 < row.error < 1e-5 and row.steps > 9
    # Two runs of one program: even a busy machine makes no factor of five between the lesser of two times.
    assert 0.2 < paired_runs.paired_costs([row])[0].times < 5.0


def test_a_pair_whose_other_checkout_fails_says_why(tmp_path, monkeypatch):
    (tmp_path / "ldcs_ros").mkdir()
    (tmp_path / "ldcs_ros" / "__init__.py").write_text("raise SystemExit('no scenes here')")
    monkeypatch.setattr(paired_runs, "SPAN", 0.01)
    (row,) = perform(Task("paired", "paper", 9, "auto", "smooth", 100.0, 1, checkout=str(tmp_path)))
    assert f"{tmp_path} ended with 1: no scenes here" in row.failure


def test_noise_lies_on_the_course_and_commands_stay_positive():
    smooth, noisy = (paired_runs.commands("rig", kind, 1000.0) for kind in ("smooth", "noisy"))
    assert len(smooth) == 1600 and max(smooth) == pytest.approx(140e3, rel=1e-9) and min(noisy) == 0.0
    off = [a - b for a, b in zip(noisy, smooth, strict=True)]
    assert (sum(e * e for e in off) / len(off)) ** 0.5 == pytest.approx(1400.0, rel=0.05)


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

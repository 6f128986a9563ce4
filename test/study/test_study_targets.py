"""Targets, growth, orders and bounds are what the rows say."""

from __future__ import annotations

import math

import pytest

from ldcs_ros.study import growth, orders, sections, stabilised
from ldcs_ros.study.targets import Target, targets
from ldcs_ros.study.tasks import Row, Task, perform


def curve(method, error, cpu, *, scene="arc", nodes=9, setting="accuracy", value=0.0, failure=""):
    value = value or error
    return Row("curve", scene, nodes, method, setting, value, error=error, cpu=cpu, steps=9, failure=failure)


def grown(nodes, cpu, peak=500, failure=""):
    extra = f"peak {peak}"
    return Row(
        "growth", "arc_material", nodes, "esdirk43", "accuracy", 1e-5, cpu=cpu, extra=extra, failure=failure
    )


def rated(rate, cpu, error=1e-6, method="esdirk43"):
    return Row("rate", "paper", 9, method, "rate", rate, error=error, cpu=cpu, steps=4)


def found(rows, words):
    (target,) = [target for target in targets(rows) if words in target.name]
    return target


def test_a_speed_is_kept_missed_or_not_measured():
    rows = [curve("esdirk43", 1e-6, 0.005), curve("compiled_rkc2", 1e-6, 0.02), curve("scipy_BDF", 5e-5, 0.1)]
    fast = found(rows, "`arc` 9 x 9, error <= 1e-05")
    assert fast.kept and fast.verdict == "kept" and "200 x" in fast.reached
    assert fast.beside == "compiled RKC2: 4.0 times ours; SciPy BDF: 20.0 times ours, error 5.0e-05 m"
    assert found(rows, "`arc` 33 x 33").verdict == "-"
    slow = found([curve("esdirk43", 1e-5, 2.0, nodes=65)], "65 x 65")
    assert slow.kept is False and slow.verdict == "MISSED"


def test_a_run_that_failed_misses_its_target_with_the_reason():
    rows = [curve("esdirk43", math.nan, math.nan, nodes=65, failure="too slow: 9 CPU s per simulated second")]
    assert found(rows, "65 x 65") == Target(
        "`arc` 65 x 65, error <= 2e-05 m", ">= 1 x real time", rows[0].failure, False
    )


def test_growth_counts_from_end_to_end_and_by_least_squares():
    rows = [grown(n, 1e-4 * float(n) ** 2.4) for n in (17, 33, 65, 129)]
    assert growth.exponents(rows) == pytest.approx((1.2, 1.2))
    assert found(rows, "nodes to the power").kept
    assert found(rows, "peak memory").kept
    assert found([*rows[:-1], grown(129, 9e3, peak=2100)], "peak memory").kept is False
    steep = found([grown(n, 1e-4 * n**3) for n in (17, 129)], "nodes to the power")
    assert steep.kept is False and "1.50" in steep.reached
    part = found(rows[:2], "nodes to the power")
    assert part.kept is None and "only 17 to 33" in part.reached
    assert found([grown(129, 1.0, failure="no memory")], "peak memory").kept is False


def test_commands_are_judged_by_the_smooth_case_and_by_their_error():
    rows = [rated(0.0, 0.01), rated(100.0, 0.019), rated(1000.0, 0.5), rated(100.0, 0.19, method="scipy_BDF")]
    hundred = found(rows, "commands at 100 Hz")
    assert (
        hundred.kept and "0.53 of smooth" in hundred.reached and "SciPy BDF: 10 times ours" in hundred.beside
    )
    assert found(rows, "commands at 1000 Hz").verdict == "-"
    assert found([rated(0.0, 0.01), rated(100.0, 0.021)], "100 Hz").kept is False
    assert found([rated(0.0, 0.01), rated(100.0, 0.01, error=2e-5)], "100 Hz").kept is False


def test_the_promise_counts_a_failed_run_as_lost():
    good = [
        Row("promise", "arc", 9, "esdirk43", "accuracy", 1e-5, error=4e-6, cpu=0.1),
        Row("promise", "rig", 9, "esdirk43", "accuracy", 1e-5, error=5e-6, cpu=0.1),
    ]
    assert found(good, "within the asked").kept and found(good, "largest real error").reached == "0.50"
    lost = [*good, Row("promise", "paper", 0, "auto", "accuracy", 0.0, failure="diverged")]
    assert found(lost, "within the asked").kept is False and found(lost, "largest real error").kept is False


def test_orders_come_from_the_errors_at_fixed_steps():
    rows = [
        curve("trbdf2", 1e-4 * (h / 0.02) ** 2, 0.1, setting="dt", value=h) for h in (0.005, 0.02, 0.01)
    ] + [curve("rosenbrock_w", 1e-5 * (h / 0.01) ** 2.3, 0.1, setting="dt", value=h) for h in (0.01, 0.005)]
    assert [pair[:2] for pair in orders.orders(rows)["trbdf2"]] == [(0.02, 0.01), (0.01, 0.005)]
    assert orders.mean_order(orders.orders(rows)["trbdf2"]) == pytest.approx(2.0)
    text, table = sections.measured_orders(rows)
    assert "`rosenbrock_w` (2.3 instead of 3)" in text and "Lubich" in text
    assert "| `trbdf2` | 2 | 2.0 |" in table and "**2.3**" in table


def test_stages_of_a_stabilised_method_follow_the_root_of_its_step():
    assert stabilised.evaluations([0.1], 0.353 * 10 * 29.9**2) == 30
    assert stabilised.evaluations([1e-9], 1.0) == stabilised.LEAST_STAGES
    # Longer than its most stages reach: divided.
    assert stabilised.evaluations([1.0], 4 * 0.353 * 151.9**2) == 4 * 152


def test_a_bound_has_its_stages_and_our_own_time_of_the_same_process():
    (row,) = perform(Task("bound", "hanging_sheet", 5, "rock4_bound", "accuracy", 1e-3, 1))
    own, evaluation = stabilised.figures(row)
    assert row.failure == "" and row.evaluations > row.steps > 3
    assert own > 0.0 and row.cpu == pytest.approx(row.evaluations * evaluation * 1e-6 / 3.0, rel=1e-2)
    assert (
        "at best" in sections.fourth_order_bound([row])[0] or "loses" in sections.fourth_order_bound([row])[0]
    )


def test_a_size_is_measured_in_a_process_of_its_own(monkeypatch):
    (row,) = perform(Task("growth", "arc_material", 5, "esdirk43", "accuracy", 1e-4, 1))
    assert row.failure == "" and row.steps > 3 and 0.0 < row.cpu < 60.0
    assert 50.0 < growth.peak_memory(row) < 2000.0
    monkeypatch.setattr(growth.sys, "executable", "/bin/false")
    (row,) = perform(Task("growth", "arc_material", 5, "esdirk43", "accuracy", 1e-4, 1))
    assert "5 x 5 nodes ended with 1" in row.failure

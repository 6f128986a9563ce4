"""What the study measures is what it says: references, baseline, SciPy, costs, and the words made of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.study import accuracy_check, effect_costs, plan, tasks
from ldcs_ros.study.accuracy_check import accuracy_summary
from ldcs_ros.study.baseline import ArcBaseline
from ldcs_ros.study.drive_profiles import DRIVEN, drive_problem
from ldcs_ros.study.problems import content_of, positions, scene_of
from ldcs_ros.study.recommendation import cheapest, recommendation
from ldcs_ros.study.report import report
from ldcs_ros.study.rows import METHODS_APART, Row, Task
from ldcs_ros.study.scipy_solvers import solve
from ldcs_ros.study.tasks import perform

SHORT = (0.5,)


@pytest.fixture(autouse=True)
def short_runs(monkeypatch):
    """Half a second instead of three: the sentences are the same."""
    monkeypatch.setattr(tasks, "ERROR_TIMES", SHORT)


@pytest.fixture(scope="module")
def truth():
    return positions(scene_of("arc", 9, accuracy=1e-9).build(), SHORT)


def curve(method, error, cpu, *, scene="arc", nodes=9, failure=""):
    return Row("curve", scene, nodes, method, "accuracy", error, error=error, cpu=cpu, failure=failure)


@pytest.mark.timeout(240)  # a busy machine compiles for long
@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba the compiled baseline is plain Python")
def test_the_compiled_baseline_solves_the_same_problem_to_second_order(truth):
    errors = [np.abs(ArcBaseline(9, h, 7.1e4).run(SHORT) - truth).max() for h in (0.02, 0.005)]
    assert errors[0] < 2e-5 and errors[1] < errors[0] / 8.0


@pytest.mark.parametrize("method", ["BDF", "Radau"])
def test_scipys_solvers_agree_with_the_reference(truth, method):
    motion, counts = solve(scene_of("arc", 9).build(), method, 1e-6, SHORT)
    assert np.abs(motion - truth).max() < 5e-6
    assert counts.evaluations > 0 and counts.factorisations > 0


def test_a_point_of_a_curve_has_the_real_error_and_the_counts(truth):
    (row,) = perform(Task("curve", "arc", 9, "esdirk43", "accuracy", 1e-5, 1), truth)
    assert row.failure == "" and 0.0 < row.error < 1e-5 and 0.0 < row.cpu < 5.0
    assert row.steps > 10 and row.evaluations > row.steps


def test_a_step_above_the_stability_limit_becomes_a_row_that_says_so(truth):
    (row,) = perform(Task("curve", "arc", 9, "rk4", "dt", 1e-4), truth)
    assert "above the stability limit" in row.failure and math.isnan(row.error)


def test_a_run_that_would_take_too_long_is_not_started(truth):
    (row,) = perform(Task("curve", "arc", 9, "semi_implicit_euler", "dt", 2e-5, 1, budget=0.01), truth)
    assert row.failure.startswith("too slow: ") and row.cpu > 0.0


def test_an_effect_that_is_left_out_makes_an_evaluation_cheaper(monkeypatch):
    monkeypatch.setattr(effect_costs, "SPAN", 0.01)
    monkeypatch.setattr(effect_costs, "CALLS", 50)
    rows = {row.setting: row for row in perform(Task("effect", "rig", 9, "esdirk43", "leave out", 0.0))}
    force = {name: float(row.extra.split()[1]) for name, row in rows.items() if not row.failure}
    assert {"none", "springs", "arms", "drag"} <= set(force)
    assert force["drag"] < force["none"] and force["springs"] < force["none"]


def test_the_real_error_is_measured_for_each_accuracy(monkeypatch):
    monkeypatch.setattr(accuracy_check, "TIMES", (0.1, 0.2))
    rows = perform(Task("accuracy", "single_spring", 0, "auto", "accuracy", 0.0))
    assert [row.value for row in rows] == list(accuracy_check.ACCURACIES)
    assert accuracy_summary(rows).met
    large = Row("accuracy", "arc", 9, "esdirk43", "accuracy", 1e-5, error=3.1e-5)
    assert not accuracy_summary([*rows * 10, large]).met


def test_steps_of_environments_have_their_cost_and_their_episodes():
    pytest.importorskip("gymnasium", reason="the extra [rl] is not installed")
    rows = tasks.perform(replace(plan.LEARNING, value=60.0))
    assert [row.method for row in rows] == ["reach", "follow"] and not any(row.failure for row in rows)
    assert all(0.0 < row.cpu < 60.0 and row.extra == "period 0.05 solved 1 of 1" for row in rows)
    page = report(rows, machine={}, commands=["it"], picture="x.png")
    assert "| reach | `rig` |" in page and "1 of 1" in page


def test_spatial_rows_place_the_points_of_a_material_on_lattices_of_all_sizes():
    rows = [perform(Task("spatial", "arc_material", n, "esdirk43", "accuracy", 1e-4))[0] for n in (5, 9)]
    assert all(len(row.extra.split()) == 4 * 2 * 3 or not row.failure for row in rows)


def test_the_cheapest_row_is_the_cheapest_of_those_exact_enough():
    rows = [
        curve("a", 1e-4, 0.1),
        curve("a", 1e-6, 0.3),
        curve("a", 1e-6, 0.2),
        curve("a", 0.0, 0.01, failure="no"),
    ]
    assert cheapest(rows, 1e-5).cpu == 0.2
    assert cheapest(rows, 1e-9) is None


def test_the_recommendation_follows_the_numbers():
    rows = [curve("esdirk43", 1e-6, 0.01), curve("rkc2", 1e-6, 0.04), curve("compiled_rkc2", 1e-6, 0.05)]
    text = recommendation(rows)
    assert (
        text.startswith("Use `esdirk43` (the default)") and "5.0 times as fast as the compiled RKC2" in text
    )
    assert "Slower in every test: `rkc2`" in text
    assert recommendation([curve("esdirk43", 1e-6, 0.04), curve("rkc2", 1e-6, 0.01)]).startswith("Use `rkc2`")
    assert "Too few rows" in recommendation([])


def test_the_report_tells_targets_and_failures():
    rows = [
        curve("esdirk43", 1e-6, 0.02),
        curve("rk4", math.nan, 9.0, failure="too slow: 9 CPU s per simulated second"),
    ]
    text = report(
        rows, machine={"processor": "a"}, commands=["ldcs study --targets", "ldcs study"], picture="x.png"
    )
    assert "Made by `ldcs study --targets` and then `ldcs study`, in one process" in text
    assert "| >= 100 x real time | 50 x" in text and "**MISSED**" in text
    assert "| `rk4` | accuracy nan | too slow" in text


def test_presets_name_only_what_there_is():
    from ldcs_ros.integrators import INTEGRATORS

    for tasks_of in plan.PRESETS.values():
        listed = tasks_of()
        assert len({task.key for task in listed}) == len(listed)
        named = {task.method for task in listed if task.kind not in ("rate", "learning")}
        assert named <= {*INTEGRATORS, *METHODS_APART, "auto"}
        for scene in {task.scene for task in listed}:
            assert drive_problem(scene) if scene in DRIVEN else content_of(scene)
    assert {task.method for task in plan.full()} >= set(INTEGRATORS)
    assert {task.key for task in plan.full()} >= {task.key for task in plan.targets()}


def test_nodes_of_holes_have_no_error_and_a_lost_position_has():
    row = Row("accuracy", "perforated", 2, "esdirk43", "accuracy", 1e-4)
    known = np.array([[[0.0, 0.0, 0.0], [np.nan, np.nan, np.nan]]])
    assert row.compared(known + 3e-5, known, 1.0, 2.0).error == pytest.approx(3e-5)
    assert np.isnan(row.compared(np.full_like(known, np.nan), known, 1.0, 2.0).error)

"""`ldcs study` as a user meets it: files, resuming, processes, a cluster, refusals."""

from __future__ import annotations

import csv
import importlib.util
import json
import os
import sys
from functools import partial

import pytest
from PIL import Image

from ldcs_ros.cli.main import main
from ldcs_ros.study import diagram, execute, plan, report
from ldcs_ros.study.rows import Row, StudyError, Task

TASKS = [
    Task("curve", "single_spring", 2, name, "accuracy", value, 1)
    for name in ("esdirk43", "trbdf2")
    for value in (1e-4, 1e-5)
] + [Task("curve", "single_spring", 2, "rkc2", "dt", 0.5)]


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setitem(plan.PRESETS, "quick", lambda: list(TASKS))


@pytest.fixture
def undrawn(monkeypatch):
    """Leave the picture and the table of methods out: one test looks at them."""
    monkeypatch.setattr(diagram, "draw", lambda rows, path: path)
    monkeypatch.setattr(diagram, "draw_summary", lambda rows, path: path)
    monkeypatch.setattr(report, "methods", lambda rows: [])


def study(capsys, folder, *words):
    status = main(["study", "-o", str(folder), "--json", *words])
    printed = capsys.readouterr()
    return status, json.loads(printed.out) if printed.out else None, printed.err


def test_a_study_leaves_table_picture_and_report(capsys, tmp_path):
    status, summary, _ = study(capsys, tmp_path)
    assert status == 0 and summary["rows"] == 5 and summary["without_result"] == 1
    assert "Use `" in summary["recommendation"]
    rows = list(csv.DictReader((tmp_path / "study.csv").open()))
    assert float(rows[0]["error"]) < 1e-4 and "stability limit" in rows[-1]["failure"]
    assert "above its stability limit" in (tmp_path / "study.md").read_text()
    with Image.open(tmp_path / "work_precision.png") as image:
        assert image.width > 800


def test_an_interrupted_study_goes_on_where_it_stopped(undrawn, capsys, tmp_path, monkeypatch):
    made = []

    def perform(task, known=None):
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(task)
        return real(task, known)

    real = execute.perform
    monkeypatch.setattr(execute, "perform", perform)
    assert main(["study", "-o", str(tmp_path)]) == 130
    monkeypatch.setattr(execute, "perform", real)
    with (tmp_path / "study.csv").open("a") as file:
        file.write("curve,single_spring,2,trb")  # a power cut in the middle of a line
    _, summary, _ = study(capsys, tmp_path)
    assert (summary["rows"], summary["rows_from_before"]) == (5, 2)
    _, again, _ = study(capsys, tmp_path)
    assert again["rows_from_before"] == 5


@pytest.mark.slow
def test_rows_of_another_machine_are_not_mixed_in(undrawn, capsys, tmp_path):
    study(capsys, tmp_path)
    there = json.loads((tmp_path / "study_machine.json").read_text())
    (tmp_path / "study_machine.json").write_text(json.dumps({**there, "processor": "abacus"}))
    status, _, error = study(capsys, tmp_path)
    assert status == 2 and "processor 'abacus'" in error and "--again" in error
    status, summary, _ = study(capsys, tmp_path, "--again")
    assert status == 0 and summary["rows_from_before"] == 0


def test_a_table_that_is_none_is_refused(capsys, tmp_path):
    (tmp_path / "study.csv").write_text("a,b\n1,2\n")
    status, _, error = study(capsys, tmp_path)
    assert status == 2 and "no table of this study" in error


@pytest.mark.parametrize("words", [("--jobs", "0"), ("--jobs", "two"), ("--quick", "--full")])
def test_a_wrong_command_line_is_one_line(capsys, tmp_path, words):
    status, _, error = study(capsys, tmp_path, *words)
    assert status == 2 and error.startswith("ldcs: error: ") and error.count("\n") == 1


def test_another_checkout_is_one_of_this_project_and_goes_with_the_targets(capsys, tmp_path):
    status, _, error = study(capsys, tmp_path, "--targets", "--against", str(tmp_path))
    assert status == 2 and "ldcs_ros/__init__.py is missing" in error and "git worktree add" in error
    status, _, error = study(capsys, tmp_path, "--quick", "--against", str(tmp_path))
    assert status == 2 and "--targets" in error


@pytest.mark.slow
def test_measuring_a_preset_again_leaves_the_rows_of_others(undrawn, capsys, tmp_path, monkeypatch):
    study(capsys, tmp_path)
    monkeypatch.setitem(plan.PRESETS, "targets", lambda: TASKS[:2])
    made = []
    monkeypatch.setattr(
        execute, "perform", lambda task, known=None: made.append(task) or [Row(*task.key[:5], task.value)]
    )
    _, summary, _ = study(capsys, tmp_path, "--targets", "--again")
    assert made == TASKS[:2] and (summary["rows"], summary["rows_from_before"]) == (5, 3)
    rows = list(csv.DictReader((tmp_path / "study.csv").open()))
    assert len(rows) == 5 and not list(tmp_path.glob("*.new"))


def test_without_dask_a_scheduler_is_refused_with_the_way_out(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    status, _, error = study(capsys, tmp_path, "--scheduler", "local")
    assert status == 2 and "-m pip install distributed" in error


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="dask.distributed is not installed: make cluster"
)
@pytest.mark.timeout(240)
def test_a_local_dask_cluster_gives_the_same_rows(undrawn, capsys, tmp_path):
    status, summary, _ = study(capsys, tmp_path, "--scheduler", "local")
    assert status == 0 and summary["rows"] == 5 and summary["without_result"] == 1


@pytest.mark.slow
def test_processes_give_the_same_rows(undrawn, capsys, tmp_path):
    status, summary, _ = study(capsys, tmp_path, "--jobs", "2")
    assert status == 0 and summary["rows"] == 5 and summary["without_result"] == 1


def test_a_process_that_is_killed_is_told_with_the_way_on():
    with pytest.raises(StudyError, match="run the same command again"), execute.processes(1) as submit:
        list(submit([partial(os._exit, 1)]))


def test_targets_are_printed_and_a_missed_one_is_a_failed_check(undrawn, capsys, tmp_path, monkeypatch):
    fast, slow = (
        Row("curve", "arc", 9, "esdirk43", "accuracy", 1e-5, error=1e-6, cpu=cpu) for cpu in (0.004, 0.4)
    )
    asked = Task("curve", "arc", 9, "esdirk43", "accuracy", 1e-5)
    monkeypatch.setitem(plan.PRESETS, "targets", lambda: [asked])
    monkeypatch.setattr(execute, "reference", lambda *problem: None)
    for row, status, verdict in ((fast, 0, "met   "), (slow, 1, "MISSED")):
        monkeypatch.setattr(execute, "perform", lambda task, known, row=row: [row])
        assert main(["study", "--targets", "--again", "-o", str(tmp_path)]) == status
        printed = capsys.readouterr().out
        assert f"{verdict}  arc 9 x 9, error <= 1e-05 m: >= 100 x real time" in printed
    assert "**MISSED**" in (tmp_path / "study.md").read_text()


@pytest.mark.slow
def test_a_report_names_every_command_that_made_it(undrawn, capsys, tmp_path):
    study(capsys, tmp_path)
    study(capsys, tmp_path, "--jobs", "2")
    study(capsys, tmp_path, "--jobs", "2")
    assert (
        "Made by `ldcs study --quick` and then `ldcs study --quick --jobs 2`, in one"
        in (tmp_path / "study.md").read_text()
    )

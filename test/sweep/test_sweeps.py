"""Sweeps: rows equal to scenes settled one by one, tables that continue, failures in rows, processes and the verb."""

from __future__ import annotations

import csv
import importlib.util
import json
import os
import sys
import warnings
from functools import partial

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.study.execute import workers
from ldcs_ros.study.rows import StudyError
from ldcs_ros.sweep import Design, Factor, Sweep, SweepError, run_sweep


def rig(nodes: int, **changes):
    """Return the scene `rig` on a coarse mesh; its warnings on places are of no interest here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return load_scene("rig").edited({"lattice.nodes": [nodes, nodes], **changes})


SCENE = rig(5, inputs=None)
SMALL = rig(3)
GRID = Design((Factor("effects.payload.mass", 0.0, 0.04, 3), Factor("pressure.left", 0.0, 60e3, 2)))


def test_each_row_is_the_rest_state_of_its_own_scene(tmp_path):
    result = run_sweep(Sweep(SCENE, GRID, ("P1.z", "radius")), tmp_path / "t.csv")
    for (mass, pressure), height in zip(result.samples, result.measured[:, 0], strict=True):
        simulation = SCENE.edited({"effects.payload.mass": mass}).build()
        simulation.inputs.set_pressure([pressure, 0.0])
        simulation.settle()
        assert height == pytest.approx(simulation.pose("P1")[0][2], abs=1e-9)
    assert all(row.stable for row in result.rows)
    assert np.isfinite(result.measured[:, 1]).all()


def test_other_arms_keep_the_commands_of_the_schedule(tmp_path):
    scene = SCENE.edited({"inputs": [{"time": 0.0, "pressure": [10e3, 50e3]}]})
    design = Design((Factor("pressure.left", 30e3, 30e3, 1),))
    result = run_sweep(Sweep(scene, design, ("P1.z",)), tmp_path / "t.csv")
    simulation = scene.build()
    simulation.inputs.set_pressure([30e3, 50e3])
    simulation.settle()
    assert result.measured[0, 0] == pytest.approx(simulation.pose("P1")[0][2], abs=1e-9)


def test_a_run_in_time_is_measured_at_its_end(tmp_path):
    design = Design((Factor("effects.payload.mass", 0.01, 0.03, 2),))
    result = run_sweep(Sweep(SCENE, design, ("P1.z",), duration=0.05), tmp_path / "t.csv")
    simulation = SCENE.edited({"effects.payload.mass": 0.03}).build()
    simulation.advance_to(0.05)
    assert result.measured[1, 0] == pytest.approx(simulation.pose("P1")[0][2], abs=1e-6)
    assert result.rows[0].stable is None


def test_an_interrupted_sweep_continues_to_the_same_table(tmp_path):
    sweep = Sweep(SCENE, GRID, ("P1.z",))
    whole = run_sweep(sweep, tmp_path / "whole.csv")
    run_sweep(sweep, tmp_path / "cut.csv")
    text = (tmp_path / "cut.csv").read_text()
    # Half a line at the end, as after a power cut.
    (tmp_path / "cut.csv").write_text(text[: text.index("\n", text.index("\n2,") + 1) + 8])
    again = run_sweep(sweep, tmp_path / "cut.csv")
    assert 0 < again.continued < len(again.rows)
    np.testing.assert_array_equal(again.measured, whole.measured)
    rows = list(csv.DictReader((tmp_path / "cut.csv").open()))
    assert sorted(int(row["sample"]) for row in rows) == list(range(6))


def test_a_table_of_another_sweep_is_refused(tmp_path):
    design = Design((Factor("effects.payload.mass", 0.01, 0.02, 2),))
    run_sweep(Sweep(SCENE, design, ("P1.z",)), tmp_path / "t.csv")
    before = (tmp_path / "t.csv").read_bytes()
    with pytest.raises(SweepError, match="of another sweep"):
        run_sweep(Sweep(SCENE, design, ("P1.x",)), tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == before


def test_a_sample_out_of_bounds_fails_in_its_row_alone(tmp_path):
    limit = SCENE.effect("arms").pressure_limit
    design = Design((Factor("pressure.left", 0.0, 2.0 * limit, 3),))
    result = run_sweep(Sweep(SCENE, design, ("P1.z",)), tmp_path / "t.csv")
    assert [row.index for row in result.failures] == [2] and "expected 0 ..." in result.failures[0].failure
    assert np.isfinite(result.measured[:2]).all() and np.isnan(result.measured[2]).all()


@pytest.mark.parametrize(
    ("path", "measure", "expected"),
    [
        ("effects.payload.mas", "P1.z", "Did you mean 'mass'"),
        ("effects.payload.mass", "P7.z", "expected POINT.x"),
        ("effects.payload.mass", "P1", "expected POINT.x"),
        ("pressure.middle", "P1.z", r"expected one of \['left', 'right'\]"),
        ("torque.left", "P1.z", "no drive by torque"),
        ("wrench.P1.z", "P1.z", "expected wrench.FRAME.force.AXIS"),
    ],
)
def test_names_that_do_not_exist_are_refused_before_anything_runs(tmp_path, path, measure, expected):
    with pytest.raises(SweepError, match=expected):
        run_sweep(Sweep(SCENE, Design((Factor(path, 0.0, 0.01, 2),)), (measure,)), tmp_path / "t.csv")
    assert not list(tmp_path.iterdir())


def sweep(capsys, *words):
    status = main(["sweep", *map(str, words), "--json"])
    out, error = capsys.readouterr()
    return status, json.loads(out) if out else None, error


def test_the_verb_writes_table_and_picture_and_gives_indices(tmp_path, capsys):
    words = [
        "rig",
        "--set",
        "lattice.nodes=[3,3]",
        "--settle",
        "--measure",
        "P1.z",
        "--sampling",
        "sobol",
        "--samples",
        4,
    ]
    words += ["--over", "effects.payload.mass=0.01..0.05", "--over", "pressure.left=0..9e4", "--jobs", 1]
    status, found, _ = sweep(capsys, *words, "-o", tmp_path / "t.csv")
    assert status == 0 and found["samples"] == 16 and not found["failures"]
    assert set(found["indices"]["P1.z"]) == {"effects.payload.mass", "pressure.left"}
    assert (tmp_path / "t.png").stat().st_size > 5000
    status, found, _ = sweep(capsys, *words, "-o", tmp_path / "t.csv")
    assert status == 0 and found["continued"] == 16


@pytest.mark.slow
def test_processes_give_the_same_bytes_as_one(tmp_path, capsys):
    words = ["rig", "--set", "lattice.nodes=[3,3]", "--settle", "--measure", "P1.z"]
    words += ["--over", "effects.payload.mass=0.01..0.05:20"]
    status, _, _ = sweep(capsys, *words, "--jobs", 2, "-o", tmp_path / "two.csv")
    assert status == 0
    design = Design((Factor("effects.payload.mass", 0.01, 0.05, 20),))
    run_sweep(Sweep(SMALL, design, ("P1.z",)), tmp_path / "one.csv")
    one, two = (sorted((tmp_path / name).read_text().splitlines()) for name in ("one.csv", "two.csv"))
    assert one == two


needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="dask.distributed is not installed: make cluster"
)


@needs_dask
@pytest.mark.timeout(240)
def test_a_local_dask_cluster_gives_the_same_bytes_as_one_process(tmp_path, capsys):
    words = ["rig", "--set", "lattice.nodes=[3,3]", "--settle", "--measure", "P1.z"]
    words += ["--over", "effects.payload.mass=0.01..0.05:20"]
    status, _, error = sweep(capsys, *words, "--scheduler", "local", "-o", tmp_path / "two.csv")
    assert status == 0, error
    design = Design((Factor("effects.payload.mass", 0.01, 0.05, 20),))
    run_sweep(Sweep(SMALL, design, ("P1.z",)), tmp_path / "one.csv")
    one, two = (sorted((tmp_path / name).read_text().splitlines()) for name in ("one.csv", "two.csv"))
    assert one == two


@needs_dask
@pytest.mark.parametrize("address", ["cluster", "tcp://127.0.0.1:9"])
def test_a_scheduler_that_does_not_answer_is_told_in_one_line(tmp_path, capsys, address):
    words = ["rig", "--over", "effects.payload.mass=0.01..0.05:2", "--measure", "P1.z", "--settle"]
    status, _, error = sweep(capsys, *words, "--scheduler", address, "-o", tmp_path / "t.csv")
    assert status == 2 and f"no Dask scheduler answers at '{address}'" in error


@needs_dask
@pytest.mark.timeout(240)
def test_a_worker_that_dies_at_a_call_is_told_with_the_way_on():
    with pytest.raises(StudyError, match="run the same command again"), workers(1, "local") as submit:
        list(submit([partial(os._exit, 1)]))


def test_without_dask_a_scheduler_is_refused_with_the_way_out(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ["rig", "--over", "effects.payload.mass=0.01..0.05:2", "--measure", "P1.z", "--settle"]
    status, _, error = sweep(capsys, *words, "--scheduler", "local", "-o", tmp_path / "t.csv")
    assert status == 2 and "-m pip install distributed" in error


def test_every_sample_failing_is_status_1(tmp_path, capsys):
    words = ["free_flight", "--settle", "--over", "lattice.mass=0.1..0.2:2", "--measure", "radius"]
    status, found, _ = sweep(capsys, *words, "--jobs", 1, "-o", tmp_path / "t.csv")
    assert status == 1 and len(found["failures"]) == 2 and found["picture"] is None

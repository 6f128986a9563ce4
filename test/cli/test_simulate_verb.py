"""`ldcs simulate` records a run, sums it up, and leaves nothing half-written when its input is bad."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.twin import recorder as recorder_module


def test_a_run_is_recorded_with_inputs_nodes_and_poses(ldcs, scene_file, tmp_path):
    outcome = ldcs("simulate", scene_file, "--duration", "0.2", "--bag", tmp_path / "bag")
    assert outcome.status == 0, outcome.err
    recording = read_bag(tmp_path / "bag")
    assert {"/ldcs/nodes", "/ldcs/truth/P1/pose", "/ldcs/P1/pose", "/ldcs/joint_states"} <= set(
        recording.topics
    )
    assert len(recording.channels["/ldcs/nodes"]) == 11
    assert recording.custom_data["scene"] == scene_file.read_text()


def test_the_summary_names_what_ran_and_what_came_out(ldcs, scene_file):
    text = ldcs("simulate", scene_file, "--duration", "0.1").out
    for word in (
        "small",
        "springs, gravity, clamp, payload, arms",
        "accuracy asked 1.0e-04 m",
        "times real time",
    ):
        assert word in text
    for word in ("estimated error", "steps", "wall time", "before that", "P0", "P1"):
        assert word in text


def test_the_json_summary_agrees_with_the_simulation(ldcs, scene_file):
    outcome = ldcs("simulate", scene_file, "--duration", "0.1", "--json")
    report = json.loads(outcome.out)
    simulation = load_scene(scene_file).build()
    simulation.advance_to(0.1)
    moved = 1e3 * (
        simulation.pose("P1")[0] - simulation.points["P1"].position(simulation.lattice.reference_position)
    )
    assert np.allclose(report["displacement_mm"]["P1"], moved, rtol=0.0, atol=1e-3)
    assert report["time"] == 0.1 and report["bag"] is None and outcome.err == ""


def test_two_runs_record_the_same_bytes(ldcs, scene_file, tmp_path):
    for name in ("a", "b"):
        ldcs("simulate", scene_file, "--duration", "0.1", "--bag", tmp_path / name)
    a, b = (read_bag(tmp_path / name) for name in ("a", "b"))
    # Diagnostics report the time of the computer.
    topics = set(a.topics) - {"/diagnostics"}
    assert list(a.in_order(topics)) == list(b.in_order(topics))


def test_a_detailed_bag_holds_the_whole_state_readable_without_this_package(ldcs, scene_file, tmp_path):
    ldcs("simulate", scene_file, "--duration", "0.1", "--bag", tmp_path / "bag", "--detail")
    simulation = load_scene(scene_file).build()
    simulation.advance_to(0.1)
    with open(tmp_path / "bag" / "bag_0.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        *_, (schema, _, _, last) = reader.iter_decoded_messages(["/ldcs/lattice_state"])
        *_, (_, _, _, status) = reader.iter_decoded_messages(["/ldcs/solver_status"])
    assert np.array_equal(last.position, simulation.state.position.ravel())
    assert np.array_equal(last.link_angle, simulation.state.link_angle.ravel())
    assert b"node positions in ldcs_base [m]" in schema.data
    assert status.steps == simulation.statistics.steps and status.integrator == "esdirk43"


def test_settling_records_the_rest_state_alone(ldcs, scene_file, tmp_path):
    outcome = ldcs("simulate", scene_file, "--settle", "--bag", tmp_path / "bag", "--json")
    report = json.loads(outcome.out)
    assert "rest state" in ldcs("simulate", scene_file, "--settle").out
    assert outcome.status == 0 and report["time"] == 0.0 and report["settled"]
    assert len(read_bag(tmp_path / "bag").channels["/ldcs/nodes"]) == 1
    assert np.linalg.norm(report["displacement_mm"]["P1"]) > 1.0


def test_a_settled_sheet_stays_at_rest(ldcs, scene_file):
    still = json.loads(ldcs("simulate", scene_file, "--settle", "--json").out)["displacement_mm"]["P1"]
    later = json.loads(ldcs("simulate", scene_file, "--settle", "--duration", "0.3", "--json").out)
    assert np.allclose(later["displacement_mm"]["P1"], still, rtol=0.0, atol=0.3)


def test_a_progress_bar_is_shown_on_a_terminal_only(ldcs, scene_file, monkeypatch):
    words = ("simulate", scene_file, "--duration", "0.1")
    assert ldcs(*words).err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert "%" in ldcs(*words).err
    assert ldcs(*words, "--json").err == ""


def test_a_fixed_step_can_be_asked_for(ldcs, scene_file):
    solver = "solver={integrator: trbdf2, dt: 0.0005}"
    outcome = ldcs("simulate", scene_file, "--duration", "0.05", "--set", solver)
    assert "trbdf2, fixed step" in outcome.out and "in 100 steps (0 rejected)" in outcome.out


def test_overrides_and_seed_reach_the_run(ldcs, scene_file, tmp_path):
    words = (
        "simulate",
        scene_file,
        "--duration",
        "0.05",
        "--seed",
        "7",
        "--set",
        "effects.payload.mass=0.02",
    )
    assert ldcs(*words, "--bag", tmp_path / "bag").status == 0
    described = read_bag(tmp_path / "bag").custom_data
    assert described["seed"] == "7" and "mass: 0.02" in described["scene"]


@pytest.mark.parametrize("duration", ["0", "-1", "nan", "inf", "soon"])
def test_a_bad_duration_is_refused(duration, refused, scene_file, tmp_path):
    assert "duration" in refused("simulate", scene_file, f"--duration={duration}", "--bag", tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_a_missing_duration_is_refused(refused, scene_file):
    assert "--duration" in refused("simulate", scene_file)


def test_an_unknown_scene_is_refused_with_the_nearest_one(refused, tmp_path):
    assert "papr" in refused("simulate", "papr", "--duration", "1", "--bag", tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_bad_yaml_is_refused_with_its_line(refused, tmp_path):
    (tmp_path / "bad.yaml").write_text("title: x\nlattice: {size: [\n")
    line = refused("simulate", tmp_path / "bad.yaml", "--duration", "1", "--bag", tmp_path / "bag")
    assert "bad.yaml" in line and "line" in line
    assert not (tmp_path / "bag").exists()


def test_a_bad_key_is_refused_with_its_path(refused, scene_file, tmp_path):
    line = refused("simulate", scene_file, "--duration", "1", "--set", "effects.springs.stiffness=-5")
    assert "effects[0].stiffness" in line


def test_a_bag_that_exists_is_never_overwritten(refused, scene_file, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine.txt").write_text("keep")
    assert "exists" in refused("simulate", scene_file, "--duration", "1", "--bag", tmp_path / "bag")
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["mine.txt"]


def test_a_run_that_fails_before_its_first_step_leaves_no_bag(refused, scene_file, tmp_path):
    # A free sheet under gravity has no rest state.
    text = scene_file.read_text().replace("  - {type: clamp, edge: x_min}\n", "")
    scene_file.write_text(
        "".join(
            line
            for line in text.splitlines(True)
            if "arms" not in line and "torque" not in line and "inputs" not in line
        )
    )
    refused("simulate", scene_file, "--settle", "--bag", tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_a_recording_that_stops_early_is_told_at_the_end(ldcs, scene_file, tmp_path, monkeypatch):
    monkeypatch.setattr(
        recorder_module.Recorder, "error", "recording to bag stopped at 0.02 s: No space left on device"
    )
    outcome = ldcs("simulate", scene_file, "--duration", "0.05", "--bag", tmp_path / "bag")
    assert outcome.status == 1
    assert outcome.err == "ldcs: error: recording to bag stopped at 0.02 s: No space left on device\n"
    assert "P1" in outcome.out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_closes_its_bag(number, scene_file, tmp_path):
    bag = tmp_path / "bag"
    process = subprocess.Popen(
        [sys.executable, "-m", "ldcs_ros", "simulate", scene_file, "--duration", "100000", "--bag", bag],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        deadline = time.monotonic() + 40.0
        while time.monotonic() < deadline and not (bag.exists() and size(bag) > 200_000):
            time.sleep(0.05)
        process.send_signal(number)
        _, err = process.communicate(timeout=15)
    finally:
        if process.poll() is None:
            process.kill()
    assert process.returncode == 130
    assert err.startswith("ldcs: interrupted at t = ") and err.count("\n") == 1, err
    assert len(read_bag(bag).channels["/ldcs/nodes"]) > 1


def size(folder):
    return sum(path.stat().st_size for path in folder.iterdir())


@pytest.mark.slow
def test_the_first_run_says_that_kernels_are_compiled(tmp_path):
    pytest.importorskip("numba", reason="without numba nothing is compiled")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "ldcs_ros", "simulate", "single_spring", "--duration", "0.01"]
    runs = [
        subprocess.run(command, env=environment, capture_output=True, text=True, timeout=50, check=True)
        for _ in range(2)
    ]
    assert "compiling kernels" in runs[0].stderr
    assert "compiling" not in runs[1].stderr

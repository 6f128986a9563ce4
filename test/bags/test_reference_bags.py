"""The reference bags in bags/ replay within the accuracy asked for, and show what they are said to show."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.cli.main import main
from ldcs_ros.messages.cdr import decode
from ldcs_ros.signals.tracks import point_tracks, pressure_tracks

ROOT = Path(__file__).resolve().parents[2]
BAGS = ROOT / "bags"
NAMES = ("paper", "chirp", "impulse", "fault")
# The solver that people use, with the accuracy of the scenes; the bags were solved by others or far tighter.
SOLVER = "solver={integrator: auto, accuracy: 1.0e-5}"


@pytest.mark.parametrize("name", NAMES)
def test_a_replay_stays_within_ten_micrometres_of_the_reference(name, tmp_path, capsys):
    words = ["replay", str(BAGS / name), "--bag", str(tmp_path / name), "--set", SOLVER, "--accuracy", "1e-5"]
    assert main([*words, "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert not replayed["commands"]["refused"]
    limits = ["--tolerances", str(BAGS / "tolerances.yaml"), "-o", str(tmp_path / "report")]
    status = main(["compare", str(tmp_path / name), str(BAGS / name), *limits, "--json"])
    compared = json.loads(capsys.readouterr().out)
    assert status == 0, compared["checks"]
    assert compared["surface"]["moments"] > 50 and len(compared["checks"]) == 4


def test_the_bags_are_small_and_each_is_described():
    folders = {path.name for path in BAGS.iterdir() if path.is_dir()}
    assert folders == set(NAMES)
    assert sum(path.stat().st_size for path in BAGS.rglob("*") if path.is_file()) < 5_000_000
    described = re.findall(r"^\| `(\w+)` \|", (BAGS / "README.md").read_text(), re.MULTILINE)
    assert sorted(described) == sorted(NAMES)
    for name in NAMES:
        assert read_bag(BAGS / name).custom_data["made_by"] == f"tools/make_bags.py {name}"


def test_the_paper_bag_lifts_the_sheet_by_an_independent_method():
    recording = read_bag(BAGS / "paper")
    assert "radau" in recording.custom_data["scene"]
    p1 = point_tracks(recording, truth=True)["P1"]
    assert p1.time[-1] == 3.0 and 0.03 < p1.last[2] - p1.first[2] < 0.08
    assert np.abs(p1.value[:, 1]).max() < 1e-6, "by symmetry"


def test_the_chirp_swings_faster_and_faster():
    recording = read_bag(BAGS / "chirp")
    left = pressure_tracks(recording)["left"]
    early, late = (crossings(left, low, low + 1.0) for low in (1.0, 4.0))
    assert 1 <= early <= 4 and late > early + 3
    assert len(recording.channels["/ldcs/pressure_command"]) == 251


def test_the_impulse_is_short_and_the_sheet_comes_back():
    recording = read_bag(BAGS / "impulse")
    pushes = recording.channels["/ldcs/external_wrench"]
    assert np.diff(pushes.times).tolist() == [20_000_000]
    z = point_tracks(recording, truth=True)["P1"].value[:, 2]
    assert np.ptp(z) > 2e-3 and abs(z[-1] - z[0]) < 2e-4


def test_the_fault_bag_counts_refusals_vents_and_goes_on():
    recording = read_bag(BAGS / "fault")
    health = decode("diagnostic_msgs/msg/DiagnosticArray", recording.channels["/diagnostics"].raw[-1].cdr)
    entries = {status.name.split(": ")[1]: status for status in health.status}
    counts = {pair.key: pair.value for pair in entries["commands"].values}
    for reason, count in {
        "not a number": 1,
        "over limit": 2,
        "wrong size": 1,
        "unknown frame": 1,
        "malformed": 1,
        "vented": 1,
    }.items():
        assert counts[f"refused, {reason}"] == str(count)
    commands = [decode(raw.type, raw.cdr).data for raw in recording.channels["/ldcs/pressure_command"].raw]
    assert [list(values) for values in commands[:10]] == [[1e5, 8e4]] * 10
    ramp = np.array(commands[10:-1])
    assert len(ramp) > 20 and np.all(np.diff(ramp, axis=0) <= 0.0) and not ramp[-1].any()
    assert commands[-1].tolist() == [6e4]


def test_the_recipes_still_make_a_bag(tmp_path):
    command = [sys.executable, str(ROOT / "tools" / "make_bags.py"), "impulse", "--output", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, timeout=50, cwd=ROOT)
    made, kept = read_bag(tmp_path / "impulse"), read_bag(BAGS / "impulse")
    assert made.counts == kept.counts and made.end == kept.end


def crossings(track, start, end):
    inside = (track.time >= start) & (track.time < end)
    above = track.value[inside] > np.median(track.value)
    return int(np.sum(above[1:] != above[:-1]))

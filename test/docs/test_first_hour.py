"""The commands of the first hour run in their order, on the scene that the page prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main

PAGE = (Path(__file__).resolve().parents[2] / "docs/first_hour.md").read_text(encoding="utf-8")


def write_recording(scene, path):
    """Write the recording of a rig: the scene with a smaller gain, two steps of pressure, 80 Hz."""
    rig = load_scene(str(scene)).edited({"effects.arms.pressure_gain": 0.9e-6, "inputs": None}).build()
    noise = np.random.default_rng(3)
    lines = ["t,p,x,y,z"]
    rig.inputs.set_pressure(50e3)
    rig.settle()
    for tick in range(40):
        pressure = 50.0 + 30.0 * (tick // 15)
        place = 1e3 * rig.pose("tip")[0] + noise.normal(0.0, 0.1, 3)
        lines.append(f"{12.5 * tick},{pressure},{place[0]:.3f},{place[1]:.3f},{place[2]:.3f}")
        rig.inputs.set_pressure(1e3 * pressure)
        rig.advance_to(rig.time + 0.0125)
    path.write_text("\n".join(lines) + "\n")


def test_the_first_hour_runs_as_it_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.yaml").write_text(re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[1])
    write_recording(tmp_path / "out/mine.yaml", tmp_path / "lab.csv")
    page = PAGE.replace("\\\n", " ")
    commands = re.findall(r"^    (ldcs .*)$", page, re.MULTILINE)
    assert len(commands) >= 10
    for command in commands:
        # A shorter run takes the same way.
        words = shlex.split(
            command.replace("--duration 3", "--duration 0.05").replace("--times 3", "--times 0.05")
        )
        assert main(words[1:]) == 0, command

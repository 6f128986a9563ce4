"""The examples of docs/examples run as they stand, and each gives its number."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from ldcs_ros import load_scene

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs/examples"


def run(name: str, folder: Path) -> list[float]:
    """Run an example as a user does and return the numbers that it prints."""
    command = [sys.executable, str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=55)
    assert done.returncode == 0, done.stderr
    return [float(number) for number in re.findall(r"(?<![A-Za-z])-?\d+(?:\.\d+)?(?:e-?\d+)?", done.stdout)]


def test_a_tether_from_outside_the_package_carries_the_sheet(tmp_path):
    below, expected = run("my_effect", tmp_path)
    assert expected == pytest.approx(1e3 * 0.160 * 9.81 / 100.0, abs=0.005)
    assert below == pytest.approx(expected, abs=0.02)


def test_the_command_line_runs_and_replays_a_scene_with_an_effect_from_outside(tmp_path):
    program = "import my_effect, sys; from ldcs_ros.cli.main import main; sys.exit(main())"
    assert program in (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    scene = load_scene("hanging_sheet").content
    scene["effects"].append({"type": "tether", "at": "P1"})
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    paths = os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])
    for words in ("simulate mine.yaml --duration 0.2 --bag a", "replay a --bag b"):
        done = subprocess.run(
            [sys.executable, "-c", program, *words.split()],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": paths},
            capture_output=True,
            text=True,
            timeout=55,
        )
        assert done.returncode == 0, done.stderr
    assert "the same bytes as the original" in done.stdout


def test_a_method_from_outside_the_package_has_its_order(tmp_path):
    *_, order = run("my_integrator", tmp_path)
    assert order == pytest.approx(2.0, abs=0.1)


def test_a_sensor_from_outside_the_package_is_recorded(tmp_path):
    count, length = run("my_sensor", tmp_path)
    # P1 stands at (127.5, 0, 48.6) mm and the eye at (140, 0, 300) mm; noise 0.1 mm.
    assert count == 401 and length == pytest.approx(np.hypot(140.0 - 127.5, 300.0 - 48.6), abs=0.6)


def test_the_force_of_the_tether_is_minus_its_energys_gradient(monkeypatch):
    from ldcs_ros.physics.effects import EFFECTS
    from ldcs_ros.physics.effects.base import Assembly

    spec = importlib.util.spec_from_file_location("my_effect", EXAMPLES / "my_effect.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "my_effect", module)
    monkeypatch.setitem(EFFECTS, "tether", "")
    spec.loader.exec_module(module)
    scene = load_scene("hanging_sheet")
    term = module.Tether(at="P1").bind(Assembly(scene.lattice, scene.points, scene.lattice.node_mass))
    q = scene.lattice.reference_position.ravel() + np.random.default_rng(1).normal(
        0.0, 1e-3, 3 * scene.lattice.n_nodes
    )
    force = np.zeros_like(q)
    term.add_force(0.0, q, np.zeros_like(q), None, force)
    for coordinate, slope in zip(term.where, term.jacobian(0.0, q, q, None, False)[0], strict=True):
        bump = 1e-6 * (np.arange(q.size) == coordinate)
        gradient = (term.energy(0.0, q + bump) - term.energy(0.0, q - bump)) / 2e-6
        assert force[coordinate] == pytest.approx(-gradient, rel=1e-6)
        moved = np.zeros_like(q)
        term.add_force(0.0, q + bump, np.zeros_like(q), None, moved)
        assert (moved - force)[coordinate] / 1e-6 == pytest.approx(slope, rel=1e-6)

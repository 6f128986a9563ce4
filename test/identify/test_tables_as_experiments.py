"""A table is an experiment like a bag: the same commands, places and fit."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.identify.experiments import IdentificationError, read_experiment
from ldcs_ros.signals.tables import columns_mapping

HEADER = "ms,kPa,x,y,z"
WORDS = ["initial=rest", "time=ms:ms", "pressure_command=kPa:kPa", "P1=x,y,z:mm"]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Write what a rig with a gain of 0.8e-6 N m/Pa does from its rest without pressure on, with noise."""
    simulation = load_scene("rig").without_schedule().edited({"effects.arms.pressure_gain": 0.8e-6}).build()
    simulation.settle()
    generator = np.random.default_rng(1)
    simulation.inputs.set_pressure(60e3)
    run = simulation.run(0.6, every=0.02)
    places = 1e3 * (run.channels["P1"] + generator.normal(0.0, 1e-4, (len(run.time), 3)))
    lines = [f"{1e3 * t},60,{x},{y},{z}" for t, (x, y, z) in zip(run.time, places, strict=True)]
    path = tmp_path_factory.mktemp("lab") / "lab.csv"
    path.write_text("\n".join([HEADER, *lines]) + "\n")
    return path


def test_commands_and_places_are_those_of_the_table(table):
    experiment = read_experiment(table, load_scene("rig"), mapping=columns_mapping(WORDS))
    assert [(time, topic) for time, topic, _ in experiment.commands] == [(0.0, "pressure_command")]
    np.testing.assert_array_equal(np.frombuffer(experiment.commands[0][2][-16:], dtype="<f8"), 60e3)
    assert experiment.points == ("P1",) and experiment.settled
    assert experiment.position.shape == (31, 1, 3) and experiment.time[-1] == pytest.approx(0.6)
    assert experiment.noise == pytest.approx(1e-4, rel=0.5)


def test_a_table_without_a_point_of_the_scene_is_refused(table):
    words = [*WORDS[:3], "Q=x,y,z:mm"]
    with pytest.raises(IdentificationError, match="no tracker positions of the points"):
        read_experiment(table, load_scene("rig"), mapping=columns_mapping(words))


def test_a_measured_point_that_the_scene_lacks_is_told(table):
    experiment = read_experiment(table, load_scene("rig"), mapping=columns_mapping([*WORDS, "P7.x=x:mm"]))
    assert experiment.points == ("P1",)
    assert "P7.x is of no point of the scene ['P0', 'P1']" in experiment.warnings


def test_the_hidden_gain_is_found_from_the_table(table, tmp_path, capsys):
    words = ["identify", str(table), "--scene", "rig", "--fit", "effects.arms.pressure_gain=5e-7..2e-6"]
    words += ["--starts", "1", "--processes", "1", "-o", str(tmp_path / "mine.yaml"), "--columns", *WORDS]
    assert main(words) == 0, capsys.readouterr()
    assert load_scene(tmp_path / "mine.yaml").effect("arms").pressure_gain == pytest.approx(0.8e-6, rel=0.01)


def test_one_measured_coordinate_gives_the_gain_and_is_compared(table, tmp_path, capsys):
    words = [*WORDS[:3], "P1.z=z:mm"]
    experiment = read_experiment(table, load_scene("rig"), mapping=columns_mapping(words))
    assert experiment.count == 31 and np.isfinite(experiment.position[:, 0, 2]).all()
    fit = ["identify", str(table), "--scene", "rig", "--fit", "effects.arms.pressure_gain=5e-7..2e-6"]
    fit += ["--starts", "1", "--processes", "1", "-o", str(tmp_path / "mine.yaml"), "--columns", *words]
    assert main(fit) == 0, capsys.readouterr()
    assert load_scene(tmp_path / "mine.yaml").effect("arms").pressure_gain == pytest.approx(0.8e-6, rel=0.01)
    again = ["replay", str(table), "--scene", str(tmp_path / "mine.yaml"), "--bag", str(tmp_path / "twin")]
    assert main([*again, "--columns", *words]) == 0, capsys.readouterr()
    capsys.readouterr()
    beside = ["compare", str(tmp_path / "twin"), str(table), "--columns-b", *words, "--json"]
    assert main([*beside, "-o", str(tmp_path / "report")]) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report["channels"]) == ["P1.z"]
    assert report["channels"]["P1.z"]["figures"]["value"]["rms"] == pytest.approx(1e-4, rel=0.5)
    assert not any("P1" in line for line in report["only"])


def test_a_table_needs_a_scene(table, capsys):
    assert main(["identify", str(table), "--fit", "effects.arms.pressure_gain", "--columns", *WORDS]) == 2
    assert "name a scene with --scene" in capsys.readouterr().err

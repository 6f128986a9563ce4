"""The parts of the identification: parameters, noise, experiments, statistics, workers, the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.errors import LdcsError
from ldcs_ros.identify.diagnostics import covariance, misfit, score
from ldcs_ros.identify.experiments import Experiment, estimated_noise, read_experiment
from ldcs_ros.identify.fitting import Minimum
from ldcs_ros.identify.parameters import FitParameter, check_parameters, parse_parameter
from ldcs_ros.identify.prediction import predict, residuals
from ldcs_ros.identify.workers import Workers
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

from .conftest import SCHEDULES, record, small_scene


@pytest.fixture(scope="module")
def content(guess):
    return guess.content


def test_a_parameter_without_bounds_is_looked_for_around_its_value(content):
    parameter = parse_parameter("effects.springs.stiffness", content)
    assert (parameter.low, parameter.start, parameter.high) == (20.0, 80.0, 320.0)
    assert parameter.logarithmic and parameter.value(0.5) == pytest.approx(80.0)


@pytest.mark.parametrize(("low", "high"), [(1.0, 16.0), (-1.0, 2.0), (1.0, 1.5)])
def test_shares_and_values_are_inverse_and_slopes_are_their_slopes(low, high):
    parameter = FitParameter("x", 1.1, low, high)
    for fraction in (0.0, 0.3, 1.0):
        assert parameter.fraction(parameter.value(fraction)) == pytest.approx(fraction)
        slope = (parameter.value(fraction + 1e-6) - parameter.value(fraction - 1e-6)) / 2e-6
        assert parameter.slope(fraction) == pytest.approx(slope, rel=1e-6)


def test_the_default_of_an_effect_is_a_number_to_start_from(content):
    parameter = parse_parameter("effects.arms.joint_damping", content)
    assert (parameter.start, parameter.low, parameter.high) == (0.02, 0.005, 0.08)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("effects.spings.stiffness", "no entry of the type or name 'spings'"),
        ("effects.springs.law", "expected a number"),
        ("lattice.mas", "not given in the scene"),
        ("effects.springs.stiffness=90..100", "not in 90"),
        ("effects.springs.stiffness=100..90", "low first"),
        ("effects.springs.stiffness=a..b", "cannot read the bounds"),
        ("inputs[0].pressure", "fit their effect"),
    ],
)
def test_a_parameter_that_cannot_be_fitted_is_refused(content, text, words):
    with pytest.raises(LdcsError, match=words):
        parse_parameter(text, content)


def test_bounds_that_the_scene_refuses_are_told_before_anything_runs(content):
    parameter = parse_parameter("effects.springs.damping=-1..10", content)
    with pytest.raises(LdcsError, match="-1 is refused"):
        check_parameters([parameter], content)
    twice = parse_parameter("effects.springs.damping", content)
    with pytest.raises(LdcsError, match="named twice"):
        check_parameters([twice, twice], content)


def test_noise_is_estimated_from_second_differences():
    time = np.linspace(0.0, 2.0, 161)
    clean = 0.05 * np.stack([np.sin(3 * time), np.cos(2 * time), time**2], axis=1)
    noisy = clean + np.random.default_rng(3).normal(0.0, 1e-4, clean.shape)
    assert estimated_noise([noisy]) == pytest.approx(1e-4, rel=0.15)
    with pytest.raises(LdcsError, match="--noise"):
        estimated_noise([np.zeros((50, 3))])


def test_the_truth_itself_leaves_residuals_of_one(bags, guess, content):
    experiment = read_experiment(bags["a"], guess)
    truth = {"effects.springs.stiffness": 110.0, "effects.arms.pressure_gain": 1.1e-6}
    gap = residuals(content, truth, experiment)
    assert np.mean(gap**2) == pytest.approx(1.0, abs=0.4)
    assert np.mean(residuals(content, {}, experiment) ** 2) > 100.0


def test_a_run_from_rest_is_predicted_from_rest(tmp_path, guess):
    truth = small_scene(SCHEDULES["a"])
    experiment = read_experiment(record(tmp_path / "rest", truth, seed=4, settle=True), guess)
    assert experiment.settled
    gap = predict(guess.content, experiment) - experiment.position
    assert np.abs(gap).max() < 6e-4


def test_a_controller_that_repeats_itself_costs_and_changes_nothing(tmp_path, guess):
    twin = Twin(load_scene(small_scene(SCHEDULES["b"])), RunSettings(publish_rate=5.0))
    recorder = Recorder(tmp_path / "bag", twin)
    twin.sinks.append(recorder)
    for step in range(40):
        twin.advance_to(0.01 * step)
        twin.receive("pressure_command", pressure_command(np.array([1.0e5, 9.0e4 if step < 20 else 5.0e4])))
    twin.advance_to(0.5)
    recorder.close()
    experiment = read_experiment(tmp_path / "bag", guess)
    assert [round(time, 6) for time, _, _ in experiment.commands] == [0.0, 0.2]
    gap = predict(guess.content, experiment) - experiment.position
    assert np.abs(gap).max() < 6e-4


def test_a_scene_that_has_no_answer_gives_none(bags, guess, content):
    experiment = read_experiment(bags["a"], guess)
    assert residuals(content, {"effects.springs.stiffness": -1.0}, experiment) is None


@pytest.mark.slow
def test_processes_compute_what_one_process_computes(bags, guess, content):
    experiments = [read_experiment(bags[name], guess) for name in ("a", "b")]
    candidates = [{}, {"effects.springs.stiffness": 100.0}]
    with Workers(content, experiments, processes=1) as one, Workers(content, experiments, processes=2) as two:
        for ours, theirs in zip(one.residuals(candidates), two.residuals(candidates), strict=True):
            np.testing.assert_array_equal(ours, theirs)


def _experiment(time, points=1):
    position = np.zeros((len(time), points, 3))
    return Experiment("x", (), False, (), ("P1",) * points, time, position, 1.0, "given")


def test_white_residuals_are_no_misfit_and_lasting_ones_are_before_they_are_large():
    time = np.arange(400) / 80.0
    experiment = _experiment(time)
    white = np.random.default_rng(1).normal(0.0, 1.0, (400, 3))
    finding = misfit(score([experiment], white.ravel()), 3)
    assert not finding.found and abs(finding.excess) < 4.0
    slow = white + 0.4 * np.sin(2.0 * time)[:, None]
    smooth = misfit(score([experiment], slow.ravel()), 3)
    assert smooth.found and smooth.ljung_box_z > 5.0 > smooth.excess
    large = misfit(score([experiment], 1.5 * white.ravel()), 3)
    assert large.found and "times the noise" in large.words


def test_a_direction_without_data_is_wide():
    jacobian = np.outer(np.linspace(0.0, 1.0, 50), [1.0, 1.0])
    minimum = Minimum(np.array([0.5, 0.5]), np.zeros(50), jacobian, True)
    assert np.sqrt(np.diag(covariance(minimum))).min() > 1e3


def test_the_verb_fits_writes_the_scene_and_tells_a_misfit(bags, other_law, guess, tmp_path, capsys):
    scene = tmp_path / "guess.yaml"
    scene.write_text(guess.text)
    fitted = tmp_path / "fitted.yaml"
    words = ["identify", str(bags["a"]), "--hold-out", str(bags["c"]), "--scene", str(scene), "--starts", "1"]
    words += ["--fit", "effects.springs.stiffness", "--fit", "effects.arms.pressure_gain", "--processes", "1"]
    assert main([*words, "-o", str(fitted)]) == 0
    output = capsys.readouterr().out
    assert "effects.springs.stiffness = 1" in output and "held out" in output
    assert fitted.read_text().startswith("# Fitted by `ldcs identify`, starting from the scene guess.")
    assert main([*words, "-o", str(fitted)]) == 2
    assert "exists" in capsys.readouterr().err
    one = [
        "identify",
        str(other_law),
        "--fit",
        "effects.arms.pressure_gain",
        "--starts",
        "1",
        "--processes",
        "1",
    ]
    assert main([*one, "--scene", str(scene), "--json"]) == 1
    streams = capsys.readouterr()
    assert json.loads(streams.out)["misfit"]["found"] and "misfit" in streams.err


def test_bad_input_is_one_line_and_status_2(bags, capsys):
    assert main(["identify", str(bags["a"])]) == 2
    assert "--fit" in capsys.readouterr().err
    assert main(["identify", str(bags["a"]), "--fit", "effects.springs.stiffness=1..2"]) == 2
    assert capsys.readouterr().err.count("\n") == 1

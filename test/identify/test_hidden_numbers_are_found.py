"""Synthetic truth: hidden numbers are found within their intervals, unseen bags predicted, wrong structure told."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.identify.experiments import read_experiment
from ldcs_ros.identify.identify import identify
from ldcs_ros.identify.parameters import parse_parameter
from ldcs_ros.identify.prediction import predict
from ldcs_ros.identify.scene_file import as_dict, scene_text
from ldcs_ros.signals.tracks import point_tracks

from .conftest import HIDDEN


@pytest.fixture(scope="module")
def parameters(guess):
    content = guess.content
    return [parse_parameter(path, content) for path in HIDDEN]


@pytest.fixture(scope="module")
def experiments(bags, guess):
    return {name: read_experiment(bag, guess) for name, bag in bags.items()}


@pytest.fixture(scope="module")
def found(guess, experiments, parameters):
    fitted, unseen = [experiments["a"], experiments["b"]], [experiments["c"]]
    return identify(guess, fitted, parameters, held_out=unseen, starts=3, processes=1)


def test_the_noise_is_that_of_the_recorded_tracker(experiments):
    assert experiments["a"].noise == pytest.approx(np.hypot(1e-4, 2.8e-5 / np.sqrt(12.0)))
    assert experiments["a"].count == 2 * 3 * 57


def test_hidden_numbers_are_recovered_within_their_confidence_intervals(found):
    for item in found.estimates:
        hidden = HIDDEN[item.parameter.path]
        assert item.low < hidden < item.high, item
        # The intervals are worth something, too: the start was 10 to 27 % away.
        assert item.high - item.low < 0.06 * hidden
        assert not item.at_bound and not item.undetermined


def test_a_sound_structure_leaves_only_noise(found):
    assert not found.misfit.found
    assert found.whole.reduced_chi_square == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / found.whole.count))


def test_a_held_out_bag_is_predicted_within_three_sigma_of_the_noise(found, bags, experiments):
    (unseen,) = found.held_out
    assert unseen.name == "c"
    assert unseen.within_three > 0.985
    assert unseen.reduced_chi_square < 1.3
    truth = point_tracks(read_bag(bags["c"]), truth=True)
    experiment = experiments["c"]
    places = predict(found.content, experiment)
    for number, name in enumerate(experiment.points):
        exact = np.stack(
            [np.interp(experiment.time, truth[name].time, truth[name].value[:, axis]) for axis in range(3)],
            axis=1,
        )
        at = np.isin(np.round(experiment.time, 6), np.round(truth[name].time, 6))
        assert at.any()
        assert np.abs(places[at, number] - exact[at]).max() < 3.0 * experiment.noise


def test_starts_that_end_in_one_place_are_one_minimum(found):
    assert len(found.minima) == 1
    assert found.minima[0].converged


def test_a_wrong_spring_law_is_told_as_misfit(guess, other_law, parameters):
    wrong = identify(guess, [read_experiment(other_law, guess)], parameters, starts=1, processes=1)
    assert wrong.misfit.found
    assert "structure" in wrong.misfit.words
    assert wrong.whole.reduced_chi_square > 2.0


def test_the_scene_file_says_what_was_fitted_to_what_and_loads(found, experiments, tmp_path):
    text = scene_text(found, [experiments["a"], experiments["b"]], origin="guess")
    header = [line for line in text.splitlines() if line.startswith("#")]
    for word in (
        "effects.springs.stiffness",
        "95 %",
        "a: 342 coordinates",
        "c: 342",
        "scene guess",
        "noise is left",
    ):
        assert any(word in line for line in header), word
    path = tmp_path / "fitted.yaml"
    path.write_text(text)
    scene = load_scene(path)
    assert scene.effect("springs").stiffness == pytest.approx(found.estimates[0].value)
    assert "(identified)" in scene.title
    assert as_dict(found)["minima"] == 1

"""A recording that begins in motion: its start is fitted with the numbers, and only noise is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.identify.experiments import Experiment, read_experiment
from ldcs_ros.identify.identify import identify
from ldcs_ros.identify.parameters import parse_parameter, start_parameters
from ldcs_ros.identify.prediction import linearised, residuals
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

from .conftest import HIDDEN, small_scene

BEGIN, DURATION = 0.53, 0.7  # s; the pressures of 0.5 s have not arrived
SCHEDULE = [
    {"time": 0.0, "pressure": 0.4e5},
    {"time": 0.5, "pressure": [1.4e5, 0.9e5]},
    {"time": 0.9, "pressure": [0.6e5, 1.2e5]},
]


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of the truth whose recorder was started in the middle of the run."""
    folder = tmp_path_factory.mktemp("moving") / "bag"
    twin = Twin(
        load_scene(small_scene(SCHEDULE, stiffness=110.0, gain=1.1e-6)), RunSettings(seed=3, publish_rate=5.0)
    )
    twin.advance_to(BEGIN)
    recorder = Recorder(folder, twin)
    twin.sinks.append(recorder)
    twin.advance_to(BEGIN + DURATION)
    recorder.close()
    return folder


@pytest.fixture(scope="module")
def moving(bag, guess):
    return read_experiment(bag, guess, in_motion=True)


def test_numbers_are_found_from_a_start_in_motion(moving, guess):
    found = identify(
        guess, [moving], [parse_parameter(path, guess.content) for path in HIDDEN], starts=1, processes=1
    )
    assert found.slopes == "tangents"
    assert not found.misfit.found, found.misfit
    assert found.whole.reduced_chi_square == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / found.whole.count))
    for item in found.estimates:
        hidden = HIDDEN[item.parameter.path]
        # Three standard deviations: two numbers of one sample.
        assert abs(item.value - hidden) < 3.0 / 1.96 * (item.high - item.value), item
        assert item.high - item.low < 0.1 * hidden


def test_the_same_bag_does_not_fit_a_start_at_rest(moving, guess):
    truth = {"effects.springs.stiffness": 110.0, "effects.arms.pressure_gain": 1.1e-6}
    at_rest = replace(moving, start=None)
    assert np.mean(residuals(guess.content, truth, at_rest, accuracy=1e-5) ** 2) > 25.0


def test_tangents_of_the_residuals_are_their_differences(moving, guess):
    parameters = [parse_parameter(path, guess.content) for path in HIDDEN]
    parameters += start_parameters(0, moving.start.ranges)
    values = {one.path: one.start for one in parameters}
    content, arms, n = guess.content, len(moving.start.pressure), moving.start.shapes.shape[1]
    for k, name in enumerate([f"start[0].{arms}", f"start[0].{arms + n}"]):
        values[name] = (1e-3, -1e-2)[k]
    gap, slopes = linearised(content, values, moving, accuracy=1e-6)
    np.testing.assert_allclose(gap, residuals(content, values, moving, accuracy=1e-6), atol=0.02)
    for name in ("effects.springs.stiffness", "start[0].0", f"start[0].{arms}", f"start[0].{arms + n}"):
        column = list(values).index(name)
        step = 1e-3 * (parameters[column].high - parameters[column].low)
        ahead, before = (
            residuals(content, {**values, name: values[name] + sign * step}, moving, accuracy=1e-8)
            for sign in (1.0, -1.0)
        )
        expected = (ahead - before) / (2.0 * step)
        # The tangents follow a run of 1e-6 m; differences are exact to 1e-4.
        assert np.abs(slopes[:, column] - expected).max() < 5e-3 * np.abs(expected).max(), name


def test_slopes_are_differences_where_a_contact_makes_tangents_invalid(guess):
    content = guess.content
    content["effects"].append({"type": "floor", "height": -0.3, "stiffness": 1e3})
    scene = load_scene(content)
    time = np.arange(8) / 80.0
    still = Experiment("x", (), True, (), ("P1",), time, np.zeros((8, 1, 3)), 1.0, "given")
    places = residuals(content, {}, still, accuracy=1e-5).reshape(8, 1, 3)
    found = identify(
        scene,
        [replace(still, position=places, noise=1e-4)],
        [parse_parameter("effects.springs.stiffness", content)],
        starts=1,
        processes=1,
    )
    assert found.slopes.startswith("differences: the slope of a contact jumps, and the scene has floor")

"""The reduced model follows the full one, estimates its error, and says when it is outside of its range."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import SceneError
from ldcs_ros.estimate.manifold import fit_manifold
from ldcs_ros.estimate.reduced_run import train
from ldcs_ros.estimate.training import PERIOD, full_run, random_commands

pytest.importorskip("numba")

SLEW = 150e3
LIMIT = np.array([120e3, 120e3])
CONTENT = {
    "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [5, 5], "mass": 0.16},
    "points": {"P1": ["mid", 4, 2]},
    "effects": [
        {"type": "springs", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "payload", "at": "P1", "mass": 0.04},
        {"type": "arms", "drive": "pressure", "pressure_limit": 120e3},
    ],
}


@pytest.fixture(scope="module")
def scene():
    return load_scene(CONTENT)


@pytest.fixture(scope="module")
def reduced(scene):
    return train(scene, SLEW, runs=8, duration=4.0)


def held_out(scene, seed, slew=SLEW):
    return full_run(scene, random_commands(LIMIT, slew, 60, np.random.default_rng(seed)))


def test_held_out_runs_are_followed_within_tenths_of_a_millimetre(scene, reduced):
    for seed in (101, 102, 103):
        run = held_out(scene, seed)
        errors = reduced.follow(run)
        assert errors.max() < 5e-4 and not reduced.outside
        assert np.ptp(run.coordinates[:, :150], axis=0).max() > 20 * errors.max(), "the sheet moves"
        assert 0.5 * errors.max() < reduced.error_estimate < 10.0 * errors.max()


def test_at_rest_it_stays_where_the_full_model_rests(scene, reduced):
    run = full_run(scene, np.tile([70e3, 50e3], (20, 1)))
    assert reduced.follow(run).max() < 2e-4
    assert reduced.time == pytest.approx(19 * PERIOD) and reduced.position.shape == (50, 3)


def test_a_jump_of_pressure_is_outside_of_the_range_and_said(scene, reduced):
    run = full_run(scene, np.array([[60e3, 60e3], [60e3, 60e3], [80e3, 80e3], [80e3, 80e3]]))
    reduced.follow(run)
    assert "Pa/s" in reduced.outside
    reduced.reset(run.commands[0], run.coordinates[0])
    assert reduced.outside == ""


def test_commands_stay_within_their_limits_and_slew():
    for seed in range(6):
        commands = random_commands(LIMIT, SLEW, 200, np.random.default_rng(seed))
        assert commands.shape == (200, 2) and commands.min() >= 0.0 and (commands <= LIMIT).all()
        assert np.abs(np.diff(commands, axis=0)).max() <= SLEW * PERIOD * (1 + 1e-9)


def test_a_manifold_of_squares_is_found_again():
    draw = np.random.default_rng(0)
    z = draw.normal(size=(400, 2))
    directions = np.linalg.qr(draw.normal(size=(12, 5)))[0].T
    squares = np.stack([z[:, 0] ** 2 - 1.0, z[:, 0] * z[:, 1], z[:, 1] ** 2 - 1.0], axis=1)
    samples = z * [3.0, 2.0] @ directions[:2] + 0.1 * squares @ directions[2:]
    manifold = fit_manifold(samples, 2)
    found = manifold.decode(manifold.encode(samples))
    assert np.abs(found - samples).max() < 0.02 * np.abs(samples).max()
    step = 1e-6
    for k in range(2):
        ahead, before = z[0].copy(), z[0].copy()
        ahead[k] += step
        before[k] -= step
        slope = (manifold.decode(ahead) - manifold.decode(before)) / (2 * step)
        np.testing.assert_allclose(manifold.tangent(z[0])[k], slope, atol=1e-7)


def test_a_scene_without_pressure_is_refused():
    with pytest.raises(SceneError, match="driven by pressure"):
        train(load_scene("single_spring"), SLEW)

"""The environments pass Gymnasium's checker, repeat with a seed, reward as documented, and the baseline solves them."""

from __future__ import annotations

import json
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.errors import DivergenceError, MissingPackageError, SceneError
from ldcs_ros.learning import TASKS, LinearFeedback, SurfaceEnv, make_vector


@pytest.mark.parametrize("task", TASKS)
def test_gymnasiums_checker_finds_nothing(task):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # It has no rendering to check, and asks for the registered maker, which is used below.
        check_env(SurfaceEnv(task, duration=0.2), skip_render_check=True)


def test_a_registered_environment_is_made_by_its_name():
    env = gymnasium.make("ldcs_ros.learning:ldcs/Follow-v0", duration=0.1)
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    env.step(env.action_space.sample())
    assert env.step(env.action_space.sample())[3]


def test_a_seed_repeats_an_episode_to_the_bit_and_another_does_not():
    one, two = SurfaceEnv("follow"), SurfaceEnv("follow")
    two.reset(seed=9)
    two.step(np.ones(2))
    courses = []
    for env in (one, two):
        course = [env.reset(seed=4)[0]]
        course += [env.step(np.array([0.1 * k, -0.1 * k]))[0] for k in range(3)]
        courses.append(np.array(course))
    np.testing.assert_array_equal(*courses)
    assert not np.array_equal(one.reset(seed=5)[0], courses[0][0])


def test_observation_and_reward_are_what_the_docstring_says():
    env = SurfaceEnv("reach")
    observation, _ = env.reset(seed=1)
    simulation, length = env.simulation, 0.140
    target = length * observation[0:3] + simulation.pose("P1")[0]
    np.testing.assert_allclose(observation[9:12], 0.0, atol=1e-7)
    np.testing.assert_allclose(observation[12:], -1.0)
    observation, reward, terminated, truncated, info = env.step(np.array([0.5, -2.0]))
    distance = np.linalg.norm(target - simulation.pose("P1")[0])
    assert info["distance"] == pytest.approx(distance, abs=1e-7)
    # The second action is cut to -1, where it was.
    assert reward == pytest.approx(-distance / length - 0.02 * (1.5**2) / 2.0, abs=1e-6)
    assert not terminated and not truncated
    np.testing.assert_allclose(simulation.inputs.pressure, [0.75 * 0.8 * 200e3, 0.0])
    np.testing.assert_allclose(observation[14:16], [0.5, -1.0])
    np.testing.assert_allclose(observation[12:14], simulation.state.pressure / 80e3 - 1.0, atol=1e-6)


def test_every_target_can_be_reached_at_rest():
    env = SurfaceEnv("reach")
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        target = env.length * observation[0:3] + env.simulation.pose("P1")[0]
        twin = load_scene("rig").without_schedule().build()
        env.reset(seed=seed)
        generator = np.random.default_rng()
        generator.bit_generator.state = gymnasium.utils.seeding.np_random(seed)[0].bit_generator.state
        twin.inputs.set_pressure(env.drives.command_of(generator.uniform(-0.8, 0.8, 2)))
        twin.settle()
        np.testing.assert_allclose(twin.pose("P1")[0], target, atol=1e-6)


@pytest.mark.parametrize("task", TASKS)
def test_the_baseline_solves_the_task(task):
    env = SurfaceEnv(task)
    policy = LinearFeedback(env)
    for seed in (11, 12):
        observation, _ = env.reset(seed=seed)
        truncated = False
        while not truncated:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            assert not terminated
        assert info["is_success"]
        assert info["distance"] < (5e-4 if task == "reach" else 2e-3)


def test_no_action_does_not_solve_the_task():
    env = SurfaceEnv("reach", duration=1.0)
    env.reset(seed=11)
    truncated = False
    while not truncated:
        _, _, _, truncated, info = env.step(np.array([-1.0, -1.0]))
    assert not info["is_success"]


def test_arms_that_are_driven_by_torque_are_commanded_by_torque():
    env = SurfaceEnv("reach", scene="paper", fraction=0.5, duration=0.1)
    env.reset(seed=0)
    env.step(np.array([0.0, 1.0]))
    torque = env.simulation.inputs.torque
    np.testing.assert_allclose(torque[:, 0], env.drives.highest * [0.5, 1.0])


def test_a_divergence_ends_the_episode(monkeypatch):
    env = SurfaceEnv("reach")
    env.reset(seed=0)

    def diverge(time):
        raise DivergenceError("too much")

    monkeypatch.setattr(env.simulation, "advance_to", diverge)
    _, reward, terminated, truncated, info = env.step(np.zeros(2))
    assert (reward, terminated, truncated, info["failure"]) == (-1.0, True, False, "too much")


def test_a_vector_gives_each_environment_its_own_episode():
    vector = make_vector(2, processes=False, task="reach", duration=0.1)
    observations, _ = vector.reset(seed=5)
    np.testing.assert_array_equal(observations[0], SurfaceEnv("reach").reset(seed=5)[0])
    np.testing.assert_array_equal(observations[1], SurfaceEnv("reach").reset(seed=6)[0])
    for _ in range(2):
        _, _, _, truncated, info = vector.step(np.zeros((2, 2), dtype=np.float32))
    assert truncated.all() and np.asarray(info["distance"]).shape == (2,)
    vector.close()


def test_processes_give_what_one_process_gives():
    courses = []
    for processes in (False, True):
        vector = make_vector(2, processes=processes, task="reach", duration=0.5)
        vector.reset(seed=5)
        courses.append(vector.step(np.full((2, 2), 0.25, dtype=np.float32))[0])
        vector.close()
    np.testing.assert_array_equal(*courses)


def test_what_does_not_fit_is_refused():
    for wrong in ({"period": 0.0}, {"fraction": 1.5}, {"tolerance": -1.0}, {"duration": float("nan")}):
        with pytest.raises(ValueError, match="expected a number above 0"):
            SurfaceEnv(**wrong)
    with pytest.raises(ValueError, match="expected one of \\['reach', 'follow'\\]"):
        SurfaceEnv("jump")
    with pytest.raises(SceneError, match="no point 'P9'"):
        SurfaceEnv(point="P9")
    with pytest.raises(SceneError, match="has no arms"):
        SurfaceEnv(scene="hanging_sheet", point=next(iter(load_scene("hanging_sheet").points)))


def test_without_gymnasium_the_way_out_is_named(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("ldcs_ros.learning")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingPackageError, match="-m pip install 'gymnasium"):
        import ldcs_ros.learning  # noqa: F401


def test_the_verb_prints_throughput_and_score(capsys):
    assert main(["gym", "--envs", "1", "--steps", "60", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["episodes"] == found["successes"] == 1 and found["steps_per_second"] > 1.0

"""The filter against a truth that it does not know: surface, real time, honest covariance."""

from __future__ import annotations

import time
from collections import deque

import numpy as np
import pytest
from scipy.stats import chi2

from ldcs_ros import load_scene
from ldcs_ros.estimate.basis import loaded, main_directions
from ldcs_ros.estimate.filter import SurfaceFilter
from ldcs_ros.estimate.reduced import NOMINAL, ReducedModel

TICK = 1.0 / 80.0
DELAY = 0.02
NOISE, QUANTUM = 1.0e-4, 2.8e-5
DURATION = 4.0
POINTS = ("P0", "P1")


def truth(stiffness, gain, load):
    """The scene `rig` with other springs, another gain and more load."""
    scene = loaded(load_scene("rig"), "P1", load, stiffness)
    gain *= scene.effect("arms").pressure_gain
    return scene.edited({"effects.arms.pressure_gain": gain}).with_accuracy(1e-4)


def rms(position, other):
    """Root mean square distance of all nodes [mm]."""
    return 1e3 * float(np.sqrt(((position - other) ** 2).sum(axis=1).mean()))


class Course:
    """Truth, open-loop twin and filter under the same waves of pressure."""

    def __init__(self, stiffness, gain, load, *, seed=1, without=(), duration=DURATION):
        generator = np.random.default_rng(seed)
        real, open_loop = truth(stiffness, gain, load).build(), truth(1.0, 1.0, 0.0).build()
        for simulation in (real, open_loop):
            simulation.inputs.set_pressure(0.0)
            simulation.settle()
        self.filter = SurfaceFilter(load_scene("rig"), POINTS)
        self.error, self.open_loop_error, self.squared, self.cost = [], [], [], []
        under_way = deque()
        for k in range(1, int(duration / TICK) + 1):
            now = k * TICK
            swing = 60e3 * (1.0 - np.cos(2.0 * np.pi * 0.25 * now))
            lean = 0.15 * np.sin(2.0 * np.pi * 0.13 * now)
            for simulation in (real, open_loop):
                if k % 2 == 0:
                    simulation.inputs.set_pressure((swing * (1.0 + lean), swing * (1.0 - lean)))
                simulation.advance_to(now)
            state = real.state
            places = {name: real.points[name].position(state.position) for name in POINTS}
            noisy = {name: place + generator.normal(0.0, NOISE, 3) for name, place in places.items()}
            rounded = {name: np.round(place / QUANTUM) * QUANTUM for name, place in noisy.items()}
            under_way.append((now, rounded))
            self.filter.pressure(now, state.pressure + generator.normal(0.0, 100.0, 2))
            began = time.thread_time()
            if now - under_way[0][0] >= DELAY - 1e-9:
                moment, measured = under_way.popleft()
                squared = None if k in without else self.filter.correct(moment, measured)
                if squared is not None:
                    self.squared.append(squared)
            estimate = self.filter.at(now)
            self.cost.append(time.thread_time() - began)
            self.error.append(rms(estimate.position, state.position))
            self.open_loop_error.append(rms(open_loop.state.position, state.position))
        self.estimate = estimate


@pytest.fixture(scope="module", params=[(1.2, 0.7, 0.02), (0.8, 1.3, 0.02)], ids=["stiff", "soft"])
def course(request):
    return request.param, Course(*request.param)


def test_the_estimate_is_within_a_millimetre_where_the_open_loop_twin_is_several_off(course):
    _, run = course
    later = slice(int(0.5 / TICK), None)
    assert max(run.error[later]) < 0.5
    assert float(np.mean(np.array(run.error[later]) ** 2)) ** 0.5 < 0.25
    assert float(np.mean(np.array(run.open_loop_error) ** 2)) ** 0.5 > 4.0


def test_the_hidden_parameters_are_found(course):
    (stiffness, gain, load), run = course
    found = run.estimate.parameters
    assert found["gain"] == pytest.approx(gain, abs=0.03)
    assert found["load"] == pytest.approx(9.81 * load, abs=0.03)
    assert found["stiffness"] == pytest.approx(stiffness, abs=0.06)


def test_normalised_innovations_lie_in_their_band(course):
    _, run = course
    squared = np.array(run.squared)
    low, high = chi2.ppf([0.025, 0.975], 6)
    assert 0.92 < np.mean((squared > low) & (squared < high)) < 0.98
    low, high = chi2.ppf([0.025, 0.975], 6 * len(squared)) / (6 * len(squared))
    assert low < squared.mean() / 6 < high
    assert run.filter.outliers == 0


@pytest.mark.timed
def test_it_runs_in_real_time_with_margin():
    run = Course(1.2, 0.7, 0.02, duration=2.0)
    # The first calls may compile kernels.
    assert np.mean(run.cost[20:]) < 0.8 * TICK


def test_a_single_wild_measurement_is_left_out_and_a_lasting_change_is_not():
    surface = SurfaceFilter(load_scene("rig"), POINTS)
    still = {name: surface.at(0.0).points[name][0] for name in POINTS}
    for k in range(1, 40):
        surface.correct(k * TICK, still)
    wild = {name: place + 0.05 for name, place in still.items()}
    assert surface.correct(40 * TICK, wild) is None and surface.outliers == 1
    assert rms(surface.at(40 * TICK).position, surface.at(39 * TICK).position) < 0.1
    lower = {"P0": still["P0"] + [0.0, 0.0, -0.001], "P1": still["P1"] + [-0.0005, 0.0, -0.004]}
    for k in range(41, 90):
        surface.correct(k * TICK, lower)
    assert surface.restarts == 1
    assert np.linalg.norm(surface.at(90 * TICK).points["P1"][0] - lower["P1"]) < 5e-4


def test_it_may_join_a_sheet_that_is_already_moving():
    real = truth(1.2, 0.85, 0.02).build()
    surface = SurfaceFilter(load_scene("rig"), POINTS)
    error = []
    for k in range(1, 160):
        now = k * TICK
        if k % 2 == 0:
            real.inputs.set_pressure(60e3 * (1.0 - np.cos(2.0 * np.pi * 0.5 * now)))
        real.advance_to(now)
        state = real.state
        if now > 0.8:
            surface.pressure(now, state.pressure)
            surface.correct(now, {name: real.points[name].position(state.position) for name in POINTS})
            error.append(rms(surface.at(now).position, state.position))
    assert max(error[20:]) < 1.0 and surface.restarts == 0


def test_late_measurements_are_ignored_and_gaps_bridged():
    surface = SurfaceFilter(load_scene("rig"), POINTS)
    still = {name: surface.at(0.0).points[name][0] for name in POINTS}
    surface.correct(0.5, still)
    spread = surface.at(0.5).points["P1"][1]
    assert surface.correct(0.4, still) is None
    surface.correct(3.0, still)
    assert np.isfinite(surface.at(3.1).position).all()
    assert (np.linalg.eigvalsh(spread) > 0.0).all()


def test_the_reduced_model_rests_where_the_full_one_does():
    reduced = ReducedModel(load_scene("rig"), "P1")
    for stiffness, gain, load, pressure in ((1.0, 1.0, 0.0, 60e3), (1.2, 0.7, 0.02, 120e3)):
        full = truth(stiffness, gain, load).build()
        full.inputs.set_pressure((1.1 * pressure, 0.9 * pressure))
        full.settle()
        theta = np.array([gain, 9.81 * load, stiffness])
        at_rest = reduced.equilibrium(np.array([1.1 * pressure, 0.9 * pressure]), theta)
        assert rms(reduced.position(at_rest), full.state.position) < 0.2
    assert NOMINAL.tolist() == [1.0, 0.0, 1.0]


def test_slopes_are_the_derivatives_of_the_force():
    reduced = ReducedModel(load_scene("rig"), "P1", modes=8)
    pressure, theta = np.array([80e3, 70e3]), np.array([0.9, 0.1, 1.1])
    a = reduced.equilibrium(pressure, np.array([0.9, 0.1, 1.0]))
    v = np.full(reduced.n, 1e-3)
    by_a, by_v, by_theta = reduced.slopes(a, v, pressure, np.array([0.9, 0.1, 1.0]))
    base = reduced.force(a, v, pressure, np.array([0.9, 0.1, 1.0]))
    for k in range(reduced.n):
        small = 1e-7 * np.eye(reduced.n)[k]
        slope = (reduced.force(a + small, v, pressure, np.array([0.9, 0.1, 1.0])) - base) / 1e-7
        assert np.allclose(slope, by_a[:, k], rtol=1e-3, atol=1e-3 * np.abs(by_a).max())
        slope = (reduced.force(a, v + small, pressure, np.array([0.9, 0.1, 1.0])) - base) / 1e-7
        assert np.allclose(slope, by_v[:, k], rtol=1e-3, atol=1e-3 * np.abs(by_v).max())
    for k, small in enumerate(1e-4 * np.eye(3)):
        slope = (reduced.force(a, v, pressure, theta + small) - reduced.force(a, v, pressure, theta)) / 1e-4
        assert np.allclose(slope, by_theta[:, k], rtol=1e-2, atol=1e-3 * np.abs(by_theta).max())


def test_main_directions_are_orthonormal_and_span_the_shapes():
    modes = np.random.default_rng(1).normal(size=(5, 40))
    mean, directions = main_directions(modes, 4)
    assert np.allclose(directions @ directions.T, np.eye(4))
    assert np.allclose((modes - mean) @ directions.T @ directions, modes - mean)


@pytest.mark.slow
def test_three_arms_are_estimated_too():
    middle = {"name": "middle", "from": [0.0, 0.0], "to": [0.07, 0.0]}
    sides = (
        {"name": name, "from": [0.0, y], "to": [0.14, y]} for name, y in (("left", 0.07), ("right", -0.07))
    )
    scene = load_scene("rig").edited({"effects.arms.arms": [*sides, middle], "solver.accuracy": 1e-4})
    real = loaded(scene, "P1", 0.02, 1.0).edited({"effects.arms.pressure_gain": 0.8e-6}).build()
    real.inputs.set_pressure(0.0)
    real.settle()
    estimator, draw, error = SurfaceFilter(scene, POINTS), np.random.default_rng(3), []
    for k in range(1, 161):
        now = k * TICK
        swing = 1.0 - np.cos(2.0 * np.pi * 0.5 * now)
        real.inputs.set_pressure(swing * np.array([55e3, 45e3, 20e3]))
        real.advance_to(now)
        estimator.pressure(now, real.state.pressure)
        estimator.correct(now, {name: real.pose(name)[0] + draw.normal(0.0, NOISE, 3) for name in POINTS})
        error.append(rms(estimator.at(now).position, real.state.position))
    # From the first correction on; 0.30 mm there, and 0.13 mm later.
    assert max(error) < 0.6 and max(error[20:]) < 0.3


def test_the_modes_rest_far_from_their_mean():
    scene = load_scene("three_arms").edited({"lattice.nodes": [7, 5]}, inputs=None)
    reduced, full = ReducedModel(scene, "P1"), scene.build()
    for pressure in ([0.0, 0.0, 0.0], [200e3, 200e3, 200e3], [90e3, 60e3, 80e3]):
        full.inputs.set_pressure(pressure)
        full.settle()
        at_rest = reduced.equilibrium(np.array(pressure), NOMINAL)
        assert rms(reduced.position(at_rest), full.state.position) < 0.6


@pytest.mark.slow
def test_a_scene_with_a_material_is_followed_too():
    scene = load_scene("three_arms").edited({"lattice.nodes": [9, 6], "solver.accuracy": 1e-4}, inputs=None)
    real = loaded(scene, "P1", 0.01, 1.2).build()
    real.inputs.set_pressure(0.0)
    real.settle()
    estimator, draw, error = SurfaceFilter(scene, POINTS), np.random.default_rng(3), []
    for k in range(1, 81):
        now = k * TICK
        real.inputs.set_pressure((1.0 - np.cos(np.pi * now)) * np.array([55e3, 45e3, 20e3]))
        real.advance_to(now)
        estimator.pressure(now, real.state.pressure)
        estimator.correct(now, {name: real.pose(name)[0] + draw.normal(0.0, NOISE, 3) for name in POINTS})
        error.append(rms(estimator.at(now).position, real.state.position))
    assert max(error) < 1.2 and estimator.restarts == 0


@pytest.mark.parametrize("name", ["rig", "perforated"])
def test_a_stiffness_factor_is_that_of_every_spring(name):
    scene = load_scene(name).edited({"lattice.nodes": [9, 9]})
    plain, stiffer = (loaded(scene, "P1", 0.0, factor).build().model for factor in (1.0, 1.25))
    springs = [next(term for term in model.terms if term.name == "springs") for model in (plain, stiffer)]
    np.testing.assert_allclose(springs[1].k, 1.25 * springs[0].k, rtol=1e-12)

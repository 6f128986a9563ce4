"""Explicit methods know the step at which they become unstable, refuse a longer one, and never return rubbish."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError, SolverError
from ldcs_ros.integrators import integrator_class
from ldcs_ros.integrators.base import StepFailure
from ldcs_ros.integrators.explicit import WorkingState
from ldcs_ros.integrators.rkc2 import coefficients, growth, stages
from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.physics.inputs import NO_INPUTS

PLAIN = ("semi_implicit_euler", "rk4")


def with_solver(scene, **solver):
    content = load_scene(scene).content
    return load_scene({**content, "solver": solver})


def small(scene):
    """A scene with fewer nodes, so that dense matrices are cheap."""
    content = load_scene(scene).content
    content["lattice"]["nodes"] = [min(n, 5) for n in content["lattice"]["nodes"]]
    content["points"] = {"P1": ["mid", "free_edge"]}
    content.pop("sensors", None)
    return load_scene(content)


def dense_spectrum(model, motion, inputs):
    """All eigenvalues of the linearised first-order system, by a dense solver [1/s]."""
    n = len(model.free)
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    dense = np.zeros((2, n, n))
    for block, values in zip(
        dense, model.jacobian(motion.time, motion.q, motion.u, inputs, positive_definite=False), strict=True
    ):
        np.add.at(block, (rows[used], columns[used]), values[used])
    mass = np.array([model.momentum(motion.q, unit) for unit in np.eye(n)]).T
    by_position, by_rate = np.linalg.solve(mass, dense[0]), np.linalg.solve(mass, dense[1])
    return np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [by_position, by_rate]]))


@pytest.mark.parametrize("scene", ["arc", "single_spring", "paper_no_load", "hanging_sheet"])
def test_the_fastest_mode_is_that_of_the_dense_matrix(scene):
    simulation = small(scene).build()
    simulation.advance_to(0.2)
    held, motion = simulation.inputs.held(), simulation.motion()
    mode, _ = fastest_mode(simulation.model, motion, held)
    largest = np.abs(dense_spectrum(simulation.model, motion, held)).max()
    assert 0.995 * largest <= mode.spectral_radius <= 1.05 * largest


@pytest.mark.parametrize("name", PLAIN)
@pytest.mark.parametrize("scene", ["arc", "single_spring"])
def test_steps_begin_to_grow_at_the_stability_limit(name, scene):
    simulation = load_scene(scene).build()
    model = simulation.model
    method = integrator_class(name)(model)
    rest = method.start(0.0, *model.reference_state(), NO_INPUTS)
    limit = method.stability_limit(rest, NO_INPUTS)
    # A push in all directions: the loads alone do not excite every mode.
    push = np.random.default_rng(1).normal(0.0, 1e-3, len(model.free))

    def largest_rate(h):
        course = WorkingState(0.0, rest.q.copy(), rest.u.copy(), rest.a)
        course.u[model.free] += push
        for _ in range(600):
            method.part(course, NO_INPUTS, h)
            if not np.abs(course.u).max() < 1e6:
                return np.inf
        return np.abs(course.u).max()

    assert largest_rate(0.97 * limit) < 3.0  # m/s
    assert largest_rate(1.08 * limit) > 1e3


@pytest.mark.parametrize(("name", "radius"), [("semi_implicit_euler", 2.0), ("rk4", 2.785)])
def test_a_damped_sheet_has_the_limit_of_the_real_axis(name, radius):
    simulation = small("arc").build()
    motion, held = simulation.motion(), simulation.inputs.held()
    rho = np.abs(dense_spectrum(simulation.model, motion, held)).max()
    limit = integrator_class(name)(simulation.model).stability_limit(motion, held)
    assert limit == pytest.approx(radius / rho, rel=0.03) and limit <= radius / rho * 1.002


def test_a_fixed_step_above_the_limit_is_refused_with_the_number():
    with pytest.raises(SolverError, match=r"dt = 5e-05 s is above the stability limit 3\.\d+e-05 s of rk4"):
        with_solver("arc", integrator="rk4", dt=5.0e-5).build()
    simulation = with_solver("arc", integrator="rk4", dt=3.0e-5).build()
    simulation.advance_to(0.003)
    assert simulation.statistics.steps == 100


@pytest.mark.parametrize("name", PLAIN)
def test_a_limit_that_falls_during_a_run_ends_it_instead_of_giving_rubbish(name):
    # A wide gap closes: the sheet falls onto a floor that is 100 times as stiff as its springs.
    content = load_scene("hanging_sheet").content
    content["effects"] = [
        {"type": "springs", "stiffness": 80.0, "damping": 0.05},
        {"type": "gravity"},
        {"type": "floor", "height": -0.006, "stiffness": 1e8},
    ]
    free = load_scene(content).build()
    limit = integrator_class(name)(free.model).stability_limit(free.motion(), free.inputs.held())
    content["solver"] = {"integrator": name, "dt": 0.9 * limit}
    simulation = load_scene(content).build()
    with pytest.raises(DivergenceError, match=r"stability limit|grows"):
        simulation.advance_to(0.5)
    assert np.isfinite(simulation.state.position).all()
    assert np.abs(simulation.state.position - simulation.lattice.reference_position).max() < 0.01


@pytest.mark.parametrize("name", PLAIN)
def test_adaptive_steps_above_the_limit_are_divided_into_stable_parts(name):
    reference = load_scene("arc").with_accuracy(1e-8).build()
    simulation = with_solver("arc", integrator=name, accuracy=1e-4).build()
    for twin in (reference, simulation):
        twin.advance_to(0.1)
    assert np.abs(simulation.state.position - reference.state.position).max() < 1e-4
    limit = simulation.integrator.stability_limit(simulation.motion(), simulation.inputs.held())
    assert simulation.statistics.steps < 0.5 * 0.1 / limit


def test_rkc_stages_cover_the_spectrum_that_they_are_chosen_for():
    for radius in (0.5, 10.0, 1000.0, 30000.0):
        along = [abs(growth(-share * radius, stages(radius))) for share in np.linspace(0.001, 1.0, 400)]
        assert max(along) < 1.0


def test_rkc_is_of_second_order_for_any_number_of_stages():
    for s in (2, 3, 7, 40, 200):
        for z in (1e-2, 5e-3):
            assert growth(-z, s) == pytest.approx(1 - z + z * z / 2, abs=0.5 * z**3)
        assert coefficients(s).c[s] == pytest.approx(1.0)


def test_rkc_refuses_steps_where_hardly_damped_modes_would_grow():
    simulation = load_scene("single_spring").build()
    method = integrator_class("rkc2")(simulation.model)
    motion = simulation.motion()
    limit = method.stability_limit(motion, NO_INPUTS)
    assert 0.01 < limit < 0.2
    with pytest.raises(StepFailure, match="stability limit"):
        method.step(motion, NO_INPUTS, 1.1 * limit, 1e-6)

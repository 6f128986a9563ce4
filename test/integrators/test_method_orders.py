"""Every method of the table has the order that it states, on a problem with an exact answer and on the sheet."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.integrators import INTEGRATORS, integrator_class
from ldcs_ros.integrators.base import Step
from ldcs_ros.physics.inputs import NO_INPUTS
from ldcs_ros.physics.model import Model, Motion

TIGHT = 1e-13  # m: stages are solved to rounding, so that only the method's own error shows
# Their error does not follow the step: one has none with constant loads, the other divides steps by itself.
WITHOUT_STEP_ERROR = ("exponential", "radau")
# Their steps cannot be long enough on the sheet for an order to show; test_explicit_limits.py has their limits.
LIMITED = ("rk4", "semi_implicit_euler")
# It has a compiled form for axial springs only, and leaves the oscillator's law to the one-step method.
WITHOUT_OSCILLATOR = ("bdf2",)
# Shorter steps than others need before its order shows.
SHORTER = {"bdf2": 4}
# Stiff damping takes this from the order at steps of milliseconds (Rosenbrock-W methods with old matrices).
REDUCTION = {"rosenbrock_w": 0.8}


def _errors(model: Model, name: str, end: float, counts, exact):
    errors = []
    for count in counts:
        method = integrator_class(name)(model)
        motion = method.start(0.0, *model.reference_state(), NO_INPUTS)
        for _ in range(count):
            motion = method.step(motion, NO_INPUTS, end / count, TIGHT).right
        errors.append(np.abs(motion.q - exact).max())
    return np.array(errors)


def _slope(counts, errors):
    return np.polyfit(np.log(counts), -np.log(errors), 1)[0]


def oscillator(time: float) -> float:
    """Displacement of every free node of `single_spring` [m]: m u'' = m g - 4 c u' - 4 k u from rest."""
    mass, k, c, g = 0.080 / 8, 4 * 10.0, 4 * 0.02, 9.81
    decay, natural = c / (2 * mass), np.sqrt(k / mass)
    beat = np.sqrt(natural**2 - decay**2)
    swing = np.cos(beat * time) + decay / beat * np.sin(beat * time)
    return mass * g / k * (1.0 - np.exp(-decay * time) * swing)


@pytest.mark.parametrize("name", [name for name in INTEGRATORS if name not in WITHOUT_OSCILLATOR])
def test_the_stated_order_is_the_measured_one_on_a_damped_oscillator(name):
    model = load_scene("single_spring").build().model
    end = 0.08  # s: between an extremum and a zero, where neither phase nor amplitude errors hide
    exact, _ = model.reference_state()
    exact.reshape(-1, 3)[[2, 3, 6, 7], 0] += oscillator(end)
    counts = np.array([40, 80, 160])
    errors = _errors(model, name, end, counts, exact)
    if name in WITHOUT_STEP_ERROR:
        assert errors.max() < 1e-11
        return
    assert _slope(counts, errors) == pytest.approx(integrator_class(name).order, abs=0.15)


def _sheet(law):
    content = load_scene("arc").content
    content["effects"][0]["law"] = law
    return load_scene(content).build().model


@pytest.mark.parametrize("name", [name for name in INTEGRATORS if name not in (*LIMITED, "radau")])
def test_stiff_damping_costs_no_order_on_the_sheet(name):
    # Fastest rate 7e4 1/s against steps of milliseconds: past the jump of gravity at the start, the order
    # must show.
    # The linear law's own method has rounding errors alone at steps that others need.
    linear = name == "exponential"
    span, counts = (0.8, np.array([1, 2, 4])) if linear else (0.2, np.array([8, 16, 32]))
    counts = counts * SHORTER.get(name, 1)
    model = _sheet("axiswise" if linear else "axial")
    method = integrator_class(name)(model)
    start = method.start(0.0, *model.reference_state(), NO_INPUTS)
    for _ in range(200):
        start = method.step(start, NO_INPUTS, 5e-4, TIGHT).right

    def run(count):
        method.recall(integrator_class(name)(model).memory)
        motion = start
        for _ in range(count):
            motion = method.step(motion, NO_INPUTS, span / count, TIGHT).right
        return motion.q

    exact = run(4 * counts[-1])
    errors = [np.abs(run(count) - exact).max() for count in counts]
    order = integrator_class(name).order - REDUCTION.get(name, 0.0)
    assert _slope(counts, errors) > order - 0.35


def test_a_step_is_pure_and_its_inside_meets_its_ends():
    simulation = load_scene("paper").build()
    simulation.advance_to(0.3)
    step, model = simulation._step, simulation.model
    left, right = step.left.q.copy(), step.right.q.copy()
    h = step.right.time - step.left.time
    again = simulation.integrator.step(step.left, simulation.inputs.held(), h, 1e-6)
    np.testing.assert_array_equal(step.left.q, left)
    # Other factors, other rounding of the iteration: it stops at 2 % of a step's share of the accuracy of
    # 1e-5 m.
    np.testing.assert_allclose(
        again.right.q[: 3 * simulation.lattice.n_nodes], right[: 3 * simulation.lattice.n_nodes], atol=1e-6
    )
    for motion in (step.left, step.right):
        near = step.at(motion.time + (1e-12 if motion is step.left else -1e-12), model)
        np.testing.assert_allclose(near.q, motion.q, atol=1e-10)
        np.testing.assert_allclose(near.u, motion.u, atol=1e-8)


def test_the_inside_of_a_step_is_as_good_as_its_end():
    fine = load_scene("arc").with_accuracy(1e-9).build()
    coarse = load_scene("arc").with_accuracy(1e-5).build()
    worst = 0.0
    for time in np.linspace(0.01, 2.0, 150):
        fine.advance_to(time)
        coarse.advance_to(time)
        worst = max(worst, np.abs(fine.state.position - coarse.state.position).max())
    assert worst < 1e-5


def test_inside_a_step_the_motion_is_the_quintic_through_both_ends():
    model = load_scene("single_spring").build().model
    n = len(model.free)
    curve = np.polynomial.Polynomial([0.1, -2.0, 3.0, 40.0, -500.0, 6000.0])

    def motion(time):
        q, u = model.reference_state()
        q[model.free], u[model.free] = curve(time), curve.deriv()(time)
        return Motion(time, q, u, np.full(n, curve.deriv(2)(time)))

    step = Step(motion(0.2), motion(0.25), 0.0)
    for time in (0.2, 0.203, 0.225, 0.249, 0.25):
        found, exact = step.at(time, model), motion(time)
        np.testing.assert_allclose(found.q, exact.q, rtol=1e-10)
        np.testing.assert_allclose(found.u, exact.u, rtol=1e-9)
        np.testing.assert_allclose(found.a, exact.a, rtol=1e-7)

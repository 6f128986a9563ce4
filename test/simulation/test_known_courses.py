"""Commands that are known beforehand: a smooth drive stands in for them where it makes no difference that counts."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import SceneError
from ldcs_ros.physics.drive_curve import CurveFit, DriveCurve
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.simulation.known_course import LARGEST_SHARE, known_course
from ldcs_ros.simulation.schedule import Schedule

ACCURACY = 1e-5
LARGEST = {"paper": ("torque", 0.13), "rig": ("pressure", 130e3), "three_arms": ("pressure", 100e3)}


def smooth_values(name, times, seed=0):
    """Return a random course of some slow oscillations, one value a time, and the kind of command."""
    draw, (kind, most) = np.random.default_rng(seed), LARGEST[name]
    total = np.full(len(times), 0.5)
    for rate in (0.4, 1.1, 1.9):
        total += draw.uniform(0.05, 0.15) * np.sin(2.0 * np.pi * rate * times + draw.uniform(0.0, 6.0))
    return kind, most * total


def scene_of(name, times, values, *, commands="auto", accuracy=ACCURACY, integrator="auto"):
    kind = LARGEST[name][0]
    entries = [{"time": float(t), kind: float(v)} for t, v in zip(times, values, strict=True)]
    solver = {"integrator": integrator, "accuracy": accuracy, "commands": commands}
    return load_scene(name).edited({"inputs": entries, "solver": solver})


def positions(simulation, looks):
    found = []
    for time in looks:
        simulation.advance_to(float(time))
        found.append(simulation.state.position)
    return np.array(found)


def largest_distance(some, others):
    return float(np.linalg.norm(some - others, axis=2).max())


def looks_until(end):
    return np.arange(1, round(end * 200.0) + 1) / 200.0


def course_of(scene):
    simulation = scene.build()
    given = simulation.model, simulation.motion(), simulation.inputs, scene.inputs[1:], (), ACCURACY
    return known_course(*given)


def test_a_curve_keeps_every_mean_to_rounding_and_bends_continuously():
    draw = np.random.default_rng(3)
    knots = np.concatenate([[0.0], np.cumsum(draw.uniform(0.005, 0.015, 60))])
    values = draw.standard_normal((60, 2))
    fit = CurveFit(knots)
    integral = fit.integral(values * fit.lengths[:, None])
    curve = DriveCurve(knots, fit.derivative(integral), np.array([[0, 1]]))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    means = sum(
        0.5 * weight * curve.values(np.arange(60), np.full(60, 0.5 + 0.5 * node))
        for node, weight in zip(nodes, weights, strict=True)
    )
    assert np.abs(means - values).max() <= 1e-12
    powers = [np.polynomial.Polynomial(one) for one in curve.coefficients[:, :, 0]]
    for order in range(3):
        ends = [(one.deriv(order) if order else one)(1.0) for one in powers]
        starts = [(one.deriv(order) if order else one)(0.0) for one in powers]
        gaps = (
            np.array(ends[:-1]) / fit.lengths[:-1] ** order - np.array(starts[1:]) / fit.lengths[1:] ** order
        )
        assert np.abs(gaps).max() <= 1e-6 * np.abs(np.array(starts) / fit.lengths**order).max()
    # A command changes the curve for three intervals before and after its own.
    other = values.copy()
    other[30] += 1.0
    changed = fit.derivative(fit.integral(other * fit.lengths[:, None])) - curve.coefficients
    (moved,) = np.nonzero(np.abs(changed).max(axis=(1, 2)) > 1e-9)
    assert moved.min() >= 27 and moved.max() <= 33


@pytest.mark.parametrize(("name", "rate", "jitter"), [("paper", 100.0, 0.0), ("three_arms", 100.0, 0.1)])
def test_the_estimated_difference_is_at_least_the_real_one(name, rate, jitter, monkeypatch):
    draw, end = np.random.default_rng(5), 0.25
    times = np.arange(0.0, end, 1.0 / rate)
    times[1:] += draw.uniform(-jitter, jitter, len(times) - 1) / rate
    _, values = smooth_values(name, times, seed=5)
    course = course_of(scene_of(name, times, values))
    assert course is not None and course.is_smooth[:-1].mean() > 0.9
    # Both solved far more accurately than the course is judged for.
    prepare = Schedule.prepare
    monkeypatch.setattr(
        Schedule, "prepare", lambda *of: prepare(*of[:3], None if of[3] is None else ACCURACY)
    )
    looks, tight = looks_until(end), ACCURACY / 30.0
    smooth = positions(scene_of(name, times, values, accuracy=tight).build(), looks)
    held = positions(scene_of(name, times, values, accuracy=tight, commands="held").build(), looks)
    real = largest_distance(smooth, held)
    assert 0.0 < real <= course.difference.max() + 2.0 * tight
    assert course.difference.max() <= LARGEST_SHARE * ACCURACY


@pytest.mark.parametrize(("name", "rate"), [("paper", 100.0), ("rig", 1000.0)])
def test_a_smooth_course_takes_few_steps_and_keeps_the_accuracy(name, rate):
    # The rig's sheet lies on its plates and leaves them.
    end = 0.3
    times = np.arange(0.0, end, 1.0 / rate)
    values = LARGEST[name][1] * (0.5 - 0.5 * np.cos(np.pi * times))
    smooth = scene_of(name, times, values).build()
    held = scene_of(name, times, values, commands="held", accuracy=1e-6).build()
    looks = looks_until(end)
    gap = largest_distance(positions(smooth, looks), positions(held, looks))
    assert gap <= ACCURACY and gap <= smooth.statistics.error_estimate
    assert smooth.statistics.steps < 60
    if smooth.inputs.pressure is not None:
        # Commands and chambers are those of the held commands, to rounding.
        assert smooth.state.pressure == pytest.approx(held.state.pressure, rel=1e-12)
        assert (smooth.inputs.pressure == held.inputs.pressure).all()
    else:
        assert (smooth.inputs.torque == held.inputs.torque).all()


def test_noise_and_steps_are_held():
    times = np.arange(0.0, 0.3, 0.01)
    draw = np.random.default_rng(1)
    noisy = 0.06 + 0.004 * draw.standard_normal(len(times))
    assert course_of(scene_of("paper", times, noisy)) is None
    # Held to the bit: nothing is left of the attempt.
    runs = [scene_of("paper", times, noisy, commands=commands).build() for commands in ("auto", "held")]
    for run in runs:
        run.advance_to(0.15)
    assert (runs[0].state.position == runs[1].state.position).all()
    with pytest.raises(SceneError, match=r"expected one of \['auto', 'held'\] @ .*solver.commands"):
        scene_of("paper", times, noisy, commands="smooth")


def test_a_step_inside_a_smooth_course_is_held_and_the_rest_is_smooth():
    times = np.arange(0.0, 0.5, 0.01)
    values = 0.04 + 0.03 * np.sin(4.0 * times) + np.where(times >= 0.245, 0.03, 0.0)
    course = course_of(scene_of("paper", times, values))
    assert course is not None
    near = np.abs(np.array(course.knots) - 0.25) < 0.015
    assert not course.is_smooth[near].any() and course.is_smooth[:-1].mean() > 0.6
    looks = looks_until(0.5)
    smooth, held = (scene_of("paper", times, values, commands=one).build() for one in ("auto", "held"))
    reference = scene_of("paper", times, values, commands="held", accuracy=1e-6).build()
    known = positions(reference, looks)
    assert largest_distance(positions(smooth, looks), known) <= ACCURACY
    positions(held, looks)
    assert smooth.statistics.evaluations < 0.8 * held.statistics.evaluations


def test_a_curve_stays_within_the_pressures_that_may_be_commanded():
    times = np.arange(0.0, 1.0, 0.01)
    # Down to zero, where a curve through the means would go below it.
    values = np.maximum(100e3 * np.cos(2.0 * np.pi * times), 0.0)
    course = course_of(scene_of("three_arms", times, values))
    assert course is not None
    knots = np.array(course.knots)
    for k in np.flatnonzero(course.is_smooth[:-1]):
        torque = course.curve.at(np.linspace(knots[k], knots[k + 1], 9)[:-1])
        assert torque.min() >= -1e-12 and torque.max() <= 200e3 * 1e-6


def test_a_state_on_a_course_resumes_to_the_bit():
    times = np.arange(0.0, 0.4, 0.01)
    _, values = smooth_values("three_arms", times)
    simulation = scene_of("three_arms", times, values).build()
    simulation.advance_to(0.1234)
    kept = simulation.state
    ends = []
    for _ in range(2):
        simulation.advance_to(0.3)
        ends.append((simulation.state.position.tobytes(), simulation.state.pressure.tobytes()))
        simulation.reset(kept)
    assert ends[0] == ends[1]
    # Another command ends the course: it acts from its time on.
    simulation.inputs.set_pressure(20e3)
    simulation.advance_to(0.4)
    assert (simulation.inputs.pressure == 20e3).all()
    again = scene_of("three_arms", times, values, commands="held").build()
    again.advance_to(0.1234)
    again.inputs.set_pressure(20e3)
    again.advance_to(0.4)
    gap = np.linalg.norm(simulation.state.position - again.state.position, axis=1).max()
    assert gap <= 2.0 * ACCURACY


def test_looking_does_not_change_the_answer_by_more_than_the_accuracy():
    times = np.arange(0.0, 0.3, 0.01)
    _, values = smooth_values("three_arms", times)
    runs = [scene_of("three_arms", times, values).build() for _ in range(2)]
    runs[0].advance_to(0.3)
    positions(runs[1], looks_until(0.3))
    assert np.abs(runs[0].state.position - runs[1].state.position).max() <= ACCURACY
    assert (runs[0].inputs.pressure == runs[1].inputs.pressure).all()
    assert runs[0].state.pressure == pytest.approx(runs[1].state.pressure, rel=1e-12)


def announced_run(missing):
    times = np.arange(0.0, 0.4, 0.01)
    _, values = smooth_values("three_arms", times)
    simulation = load_scene("three_arms").without_schedule().build()
    commands = [ScheduledCommand(float(t), pressure=float(v)) for t, v in zip(times, values, strict=True)]
    simulation.announce(commands)
    for k, one in enumerate(commands):
        simulation.advance_to(one.time)
        if k not in missing:
            simulation.inputs.set_pressure(one.pressure)
    simulation.advance_to(0.4)
    return simulation, times, values


def test_announced_commands_are_a_course_as_long_as_they_come():
    simulation, times, values = announced_run(missing=())
    scheduled = scene_of("three_arms", times, values).build()
    scheduled.advance_to(0.4)
    gap = np.linalg.norm(simulation.state.position - scheduled.state.position, axis=1).max()
    assert gap <= ACCURACY and simulation.statistics.steps < 60


def test_an_announced_command_that_does_not_come_ends_the_course():
    missing = range(20, 40)
    simulation, times, values = announced_run(missing)
    kept = [k for k in range(len(times)) if k not in missing]
    held = scene_of("three_arms", times[kept], values[kept], commands="held", accuracy=1e-6).build()
    held.advance_to(0.4)
    gap = np.linalg.norm(simulation.state.position - held.state.position, axis=1).max()
    assert gap <= ACCURACY
    assert (simulation.inputs.pressure == values[19]).all()


def test_derivatives_on_a_course_are_those_of_held_commands():
    times = np.arange(0.0, 0.2, 0.01)
    _, values = smooth_values("three_arms", times)
    found = []
    for commands in ("auto", "held"):
        simulation = scene_of("three_arms", times, values, commands=commands).build()
        simulation.advance_to(0.05)
        found.append(simulation.run_sensitivity([0.15], ["P1"], ["pressure.left"], with_error=False).values)
    assert found[0] == pytest.approx(found[1], rel=2e-3, abs=1e-12)

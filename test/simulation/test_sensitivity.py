"""Sensitivities at rest and the linear model agree with differences of rest states and with the twin's motion."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene

CONTENT = small_sheet(
    {"type": "payload", "at": "P1", "mass": 0.04},
    {"type": "wrench"},
    points={"P0": ["mid", 2, 2], "P1": {"x": 0.13, "y": 0.01}},
    arms={"joint_stiffness": 0.34, "links": 3},
    inputs=[{"time": 0.0, "pressure": 100e3}],
    solver={"accuracy": 1e-6},
)
COMMANDS = {"pressure.left": 50.0, "pressure.right": 50.0, "wrench.P1.force.z": 1e-3}
NUMBERS = {
    "effects.payload.mass": 1e-5,
    "effects.arms.joint_stiffness": 1e-4,
    "effects.springs.stiffness": 1e-2,
    "lattice.mass": 1e-5,
    "points.P1.x": 1e-6,
}

UNITS = {
    "effects.payload.mass": "kg",
    "effects.arms.joint_stiffness": "N m/rad",
    "effects.springs.stiffness": "N/m",
    "lattice.mass": "",
    "points.P1.x": "",
}


def resting_places(changes=None, pressures=(100e3, 100e3), push=0.0):
    simulation = load_scene(CONTENT).edited(changes or {}).build()
    simulation.inputs.set_pressure(pressures)
    simulation.inputs.set_wrench("P1_aligned", force=(0.0, 0.0, push))
    simulation.settle()
    return np.concatenate([simulation.pose(name)[0] for name in ("P0", "P1")])


@pytest.fixture(scope="module")
def settled():
    simulation = load_scene(CONTENT).build()
    simulation.settle()
    return simulation


def test_commands_have_the_slopes_of_central_differences(settled):
    found = settled.sensitivity(
        of=["P0", "P1"], to=["pressure.left", "pressure.right", "wrench.P1_aligned.force"]
    )
    assert found.rows == ("P0.x", "P0.y", "P0.z", "P1.x", "P1.y", "P1.z")
    assert found.to[2:] == tuple(f"wrench.P1_aligned.force.{axis}" for axis in "xyz")
    assert found.units == ("Pa", "Pa", "N", "N", "N") and found.values.shape == (6, 5)
    step = 100.0
    left = resting_places(pressures=(100e3 + step, 100e3)) - resting_places(pressures=(100e3 - step, 100e3))
    np.testing.assert_allclose(found.values[:, 0], left / (2 * step), rtol=1e-5, atol=1e-12)
    push = (resting_places(push=1e-3) - resting_places(push=-1e-3)) / 2e-3
    np.testing.assert_allclose(found.values[:, 4], push, rtol=1e-5, atol=1e-8)
    assert found.lowest_eigenvalue > 0.0 and not found.warning


@pytest.mark.parametrize("path", NUMBERS)
def test_numbers_of_the_scene_have_the_slopes_of_central_differences(settled, path):
    step, content = NUMBERS[path], settled.scene.content
    from ldcs_ros.schema.paths import get_number

    value = get_number(content, path)
    sensitivity = settled.sensitivity(of=["P0", "P1"], to=[path])
    assert sensitivity.units == (UNITS[path],)
    found = sensitivity.values[:, 0]
    ahead, before = (resting_places({path: value + sign * step}) for sign in (1.0, -1.0))
    slope = (ahead - before) / (2 * step)
    np.testing.assert_allclose(found, slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())


def test_the_simulation_stays_as_it_is(settled):
    before = settled.state.position.copy()
    settled.sensitivity(of=["P1"], to=["pressure.left"])
    settled.linearize()
    assert np.array_equal(settled.state.position, before)


def test_a_column_that_stands_upright_is_unstable_and_said_to_be():
    # Two masses on a strong spring above a clamped pair balance, and fall at the least push.
    content = {
        "lattice": {"size": [0.02, 0.02, 0.01], "nodes": [2, 2], "mass": 0.5},
        "points": {"P1": ["mid", 1, 0]},
        "effects": [
            {"type": "springs", "stiffness": 40.0},
            {"type": "gravity", "acceleration": [-9.81, 0.0, 0.0]},
            {"type": "clamp"},
            {"type": "wrench"},
        ],
    }
    simulation = load_scene(content).build()
    found = simulation.sensitivity(of=["P1"], to=["wrench.P1_aligned.force.z"])
    assert (found.lowest_eigenvalue <= 0.0) == bool(found.warning)


@pytest.mark.parametrize(
    ("of", "to", "words"),
    [
        (["P9"], ["pressure.left"], "expected a point"),
        (["P1"], ["pressure.middle"], "expected a command of the scene: pressure.left"),
        (["P1"], ["torque.left"], "expected a command of the scene"),
        (["P1"], ["wrench.P1"], "expected wrench"),
        (["P1"], ["effects.springs.law"], "the path of a number"),
        (["P1"], ["lattice.nodes"], "the path of a number"),
    ],
)
def test_unknown_places_and_numbers_are_refused(settled, of, to, words):
    with pytest.raises(ValueError, match=words):
        settled.sensitivity(of=of, to=to)


def test_a_small_pressure_step_moves_the_twin_as_the_linear_model_says(settled):
    linear = settled.linearize()
    assert linear.A.shape == (len(linear.state_names),) * 2 and linear.B.shape[1] == len(linear.input_names)
    twin = load_scene(CONTENT).edited({"effects.arms.fill_time": 0.0, "effects.arms.vent_time": 0.0}).build()
    twin.settle()
    start, step = twin.pose("P1")[0], 500.0
    twin.inputs.set_pressure([100e3 + step, 100e3])
    row = linear.output_names.index("P1.x")
    column = linear.input_names.index("pressure.left")
    from scipy.linalg import expm

    size = len(linear.A)
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size], whole[:size, size] = linear.A, linear.B[:, column] * step
    for time in (0.05, 0.15, 0.4):
        twin.advance_to(time)
        moved = linear.C[row : row + 3] @ expm(whole * time)[:size, size]
        np.testing.assert_allclose(twin.pose("P1")[0] - start, moved, atol=2e-6)


def test_the_static_gain_of_the_linear_model_is_the_sensitivity(settled):
    linear = settled.linearize()
    gain = -linear.C @ np.linalg.solve(linear.A, linear.B)
    found = settled.sensitivity(of=["P0", "P1"], to=["pressure.left", "pressure.right"]).values
    columns = [linear.input_names.index(name) for name in ("pressure.left", "pressure.right")]
    np.testing.assert_allclose(gain[:, columns], found, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("frequency", [2.0, 8.0])
def test_the_twin_answers_a_sine_as_the_linear_model_says(settled, frequency):
    linear, period, amplitude = settled.linearize(), 0.005, 5e-3
    twin = load_scene(CONTENT).build()
    twin.settle()
    start, last = twin.pose("P1")[0][2], round(2.0 / frequency / period)
    times, moved = [], []
    for k in range(round(0.5 / period) + last):
        push = amplitude * np.sin(2.0 * np.pi * frequency * k * period)
        twin.inputs.set_wrench("P1_aligned", force=(0.0, 0.0, push))
        twin.advance_to((k + 1) * period)
        times.append(twin.time)
        moved.append(twin.pose("P1")[0][2] - start)
    phase = 2.0 * np.pi * frequency * np.array(times[-last:])
    waves = np.stack([np.sin(phase), np.cos(phase), np.ones(last)], axis=1)
    fit = np.linalg.lstsq(waves, moved[-last:], rcond=None)[0]
    answer = (fit[0] + 1j * fit[1]) / amplitude
    row, column = linear.output_names.index("P1.z"), linear.input_names.index("wrench.P1.force.z")
    s = 2j * np.pi * frequency
    expected = linear.C[row] @ np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B[:, column])
    # Held forces: their first harmonic is smaller and half a period late.
    expected *= np.sinc(frequency * period) * np.exp(-0.5 * s * period)
    assert abs(answer - expected) < 0.01 * abs(expected)


def test_modes_are_those_of_a_mass_on_springs():
    # single_spring: 8 masses of 10 g on 4 + 4 springs in parallel move along x at sqrt(k / m).
    simulation = load_scene("single_spring").build()
    simulation.settle()
    linear = simulation.linearize(modes=40)
    natural = np.sqrt(4 * 10.0 / (0.080 / 8)) / (2.0 * np.pi)
    assert np.abs(linear.frequencies - natural).min() < 0.02 * natural
    assert np.all(np.diff(linear.frequencies) >= 0.0)


def test_the_linear_model_goes_to_scipy(settled):
    linear = settled.linearize(modes=3)
    system = linear.to_scipy()
    assert system.A.shape == linear.A.shape and system.D.shape == linear.D.shape
    assert len(linear.modes) == 3 and np.isclose(
        np.linalg.norm(linear.modes[0][:150].reshape(-1, 3), axis=1).max(), 1.0
    )


@pytest.mark.parametrize(
    ("frame", "wrench"),
    [
        ("P1", {"force": (0.05, 0.02, 0.4)}),
        ("P1", {"torque": (0.004, 0.006, 0.002)}),
        ("P1_aligned", {"torque": (0.004, 0.006, 0.002)}),
    ],
)
def test_a_wrench_that_turns_with_the_sheet_counts_in_the_derivatives(frame, wrench):
    def places(mass, pressure):
        simulation = load_scene(CONTENT).edited({"effects.payload.mass": mass}).build()
        simulation.inputs.set_pressure(pressure)
        simulation.inputs.set_wrench(frame, **wrench)
        simulation.settle()
        return simulation

    def difference(*steps):
        ends = [places(0.04 + s * steps[0], 100e3 + s * steps[1]).pose("P1")[0] for s in (1.0, -1.0)]
        return 0.5 * (ends[0] - ends[1])

    found = places(0.04, 100e3).sensitivity(of=["P1"], to=["effects.payload.mass", "pressure.left"])
    np.testing.assert_allclose(found.values[:, 0], difference(1e-5, 0.0) / 1e-5, rtol=2e-5, atol=1e-7)
    both = (
        places(0.04, 100e3).sensitivity(of=["P1"], to=["pressure.left", "pressure.right"]).values.sum(axis=1)
    )
    np.testing.assert_allclose(both, difference(0.0, 50.0) / 50.0, rtol=2e-5, atol=1e-12)


def test_the_linear_model_of_a_motion_has_the_slopes_of_its_accelerations():
    content = small_sheet(nodes=(3, 3), arms={"links": 2, "drive": "torque", "link_mass": 0.05})
    simulation = load_scene({**content, "inputs": [{"time": 0.0, "torque": [0.1, -0.05]}]}).build()
    simulation.advance_to(0.02)
    linear, model, motion = simulation.linearize(modes=1), simulation.model, simulation.motion()
    n, held, random = len(model.free), simulation.inputs.held(), np.random.default_rng(0)
    for _ in range(3):
        way, rates = random.normal(size=(2, n))
        ends = []
        for sign in (1e-6, -1e-6):
            q, u = motion.q.copy(), motion.u.copy()
            q[model.free] += sign * way
            u[model.free] += sign * rates
            ends.append(model.accelerate(motion.time, q, u, held))
        slope = (ends[0] - ends[1]) / 2e-6
        found = linear.A[n:] @ np.concatenate([way, rates])
        assert np.abs(found - slope).max() < 1e-5 * np.abs(slope).max()

"""Tangents of a run are the derivatives of its frozen steps, and near those of the motion itself."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.integrators.esdirk43 import Esdirk43
from ldcs_ros.schema.paths import get_value
from ldcs_ros.simulation.run_sensitivity import TangentRun
from ldcs_ros.simulation.run_starts import StartColumns, start_modes

# It turns with the sheet, and so does its derivative.
WRENCH = {"wrench": {"frame": "P1", "force": [0.1, 0.05, 0.1], "torque": [0.002, 0.003, 0.001]}}
CONTENT = {
    "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [4, 4], "mass": 0.16},
    "points": {"P0": ["mid", 2, 2], "P1": {"x": 0.13, "y": 0.01}},
    "effects": [
        {"type": "springs", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "payload", "at": "P1", "mass": 0.04},
        {"type": "arms", "drive": "pressure", "joint_stiffness": 0.34, "links": 3},
        {"type": "wrench"},
    ],
    "inputs": [{"time": 0.0, "pressure": 100e3, **WRENCH}, {"time": 0.15, "pressure": [60e3, 120e3]}],
    "solver": {"accuracy": 1e-5},
}
COMPILED = CONTENT | {"inputs": [{"time": 0.0, "pressure": 100e3}, CONTENT["inputs"][1]]}
PATHS = {
    "effects.payload.mass": 1e-4,
    "effects.arms.joint_stiffness": 1e-4,
    "effects.arms.link_mass": 1e-5,
    "effects.arms.fill_time": 1e-5,
    "effects.springs.damping": 1e-3,
    "lattice.mass": 1e-5,
    "points.P1.x": 1e-6,
    "inputs[1].pressure[0]": 10.0,
}
TIMES = (0.1, 0.3)


def tangent_run(content, to):
    simulation = load_scene(content).build()
    run = TangentRun(simulation, np.array(TIMES), ["P0", "P1"], to, settled=False, tight=True)
    run.go()
    return run


def frozen(content, grid, changes):
    """Return the free coordinates at the end of given steps, of a scene with other numbers."""
    simulation = load_scene(content).edited(changes).build()
    model = simulation.model
    method = Esdirk43(model)
    method.iteration_share = 1e-3
    q, u = model.reference_state()
    held = simulation.inputs.held()
    motion = method.start(0.0, q, u, held)
    for start, end in grid:
        simulation.time = start
        if start == simulation.scene.inputs[1].time:
            simulation.inputs.apply_scheduled(simulation.scene.inputs[1])
            held = simulation.inputs.held()
            motion = method.start(start, motion.q, motion.u, held)
        motion = method.step(motion, held, end - start, 1e-11).right
    return motion.q[model.free]


# Compiled code solves the stages where no wrench rotates with the sheet.
@pytest.fixture(
    scope="module",
    params=[pytest.param(CONTENT, marks=pytest.mark.slow), COMPILED],
    ids=["matrices", "compiled"],
)
def content_and_run(request):
    return request.param, tangent_run(request.param, list(PATHS))


@pytest.mark.parametrize("path", PATHS)
def test_tangents_are_derivatives_of_the_frozen_steps(content_and_run, path):
    content, run = content_and_run
    value = get_value(CONTENT, path)
    if value is None:
        value = getattr(load_scene(CONTENT).effect("arms"), path.rpartition(".")[2])
    step = 20.0 * PATHS[path]
    slopes = [
        (
            frozen(content, run.grid, {path: value + part * step})
            - frozen(content, run.grid, {path: value - part * step})
        )
        / (2.0 * part * step)
        for part in (1.0, 2.0)
    ]
    expected = (4.0 * slopes[0] - slopes[1]) / 3.0
    column = run.tangents.q[:, list(PATHS).index(path)]
    scale = np.abs(column).max()
    assert np.abs(column - expected).max() <= 1e-7 * scale + 1e-14


def places(changes, *, settled=False, start=None, accuracy=1e-6, times=TIMES):
    simulation = load_scene(CONTENT).edited({"solver": {"accuracy": accuracy}, **changes}).build()
    if settled:
        simulation.settle()
    if start is not None:
        state = simulation.state
        velocity = state.velocity.copy()
        velocity[simulation.lattice.node("top", 2, 2), 2] += start
        simulation.start_from(
            state.position, velocity, link_angle=state.link_angle, link_rate=state.link_rate
        )
    found = []
    for time in times:
        simulation.advance_to(simulation.time + time if settled else time)
        found.append(np.concatenate([simulation.pose(name)[0] for name in ("P0", "P1")]))
    return np.array(found)


@pytest.mark.slow
def test_stated_errors_hold_against_the_converged_motion():
    names = ["pressure.left@0.15", "effects.payload.mass", "start.velocity.node_top_2_2.z"]
    found = load_scene(CONTENT).build().run_sensitivity(TIMES, ["P0", "P1"], names)
    assert found.to == tuple(names) and found.units == ("Pa", "kg", "m/s")
    assert found.values.shape == (2, 6, 3) == found.error.shape and found.rows[4] == "P1.y"
    differences = [
        ({"inputs[1].pressure[0]": 60e3 + 200.0}, {"inputs[1].pressure[0]": 60e3 - 200.0}, None, 400.0),
        ({"effects.payload.mass": 0.0401}, {"effects.payload.mass": 0.0399}, None, 2e-4),
        ({}, {}, 0.01, 0.02),
    ]
    for column, (ahead, before, start, width) in enumerate(differences):
        back = None if start is None else -start
        slope = (places(ahead, start=start) - places(before, start=back)) / width
        gap = np.abs(found.values[:, :, column] - slope)
        scale = np.abs(slope).max()
        assert gap.max() < 2e-3 * scale
        assert (gap <= found.error[:, :, column] + 1e-4 * scale).mean() > 0.9
        assert found.error[:, :, column].max() < 0.02 * scale


def test_a_settled_run_stays_on_the_branch_of_rest_states():
    simulation = load_scene(CONTENT).build()
    simulation.settle()
    names = ["pressure.left", "wrench.P1.force.z", "effects.payload.mass", "points.P1.x"]
    static = simulation.sensitivity(["P0", "P1"], names)
    before = simulation.state.position.copy()
    start = simulation.time
    # A wrench that is switched on moves away from the first; the others only follow their rest state.
    run = simulation.run_sensitivity(
        [start, start + 0.5], ["P0", "P1"], names, settled=True, with_error=False
    )
    assert run.error is None
    np.testing.assert_array_equal(simulation.state.position, before)
    for moment in run.values:
        np.testing.assert_allclose(moment, static.values, rtol=1e-5, atol=1e-10)


def test_a_push_of_a_resting_sheet_is_resolved():
    # The run itself does not move: its own steps grow to a second.
    simulation = load_scene(CONTENT).edited({"inputs": [{"time": 0.0, "pressure": 100e3}]}).build()
    simulation.settle()
    times = simulation.time + np.array([0.02, 0.06, 0.2])
    push = ["start.velocity.node_top_2_2.z"]
    run = simulation.run_sensitivity(times, ["P1"], push)
    fine = simulation.scene.edited({"solver": {"accuracy": 1e-7}}).build()
    fine.settle()
    expected = fine.run_sensitivity(times, ["P1"], push, with_error=False).values
    gap = np.abs(run.values - expected)
    assert gap.max() < 0.02 * np.abs(expected).max()
    assert (gap <= run.error).mean() > 0.9


@pytest.mark.parametrize(
    ("to", "times", "words"),
    [
        ("pressure.left@0.2", (0.3,), "expected a time of the scene's schedule for pressure: 0, 0.15"),
        ("inputs[1].time", (0.3,), "moves the time of a command or valve"),
        ("start.position.node_top_0_0.z", (0.3,), "free along z"),
        ("start.speed.mode_1", (0.3,), "start.velocity of mode_1"),
        ("effects.payload.at", (0.3,), "the path of a number"),
        ("pressure.left", (0.3, 0.2), "times that do not rise"),
        ("pressure.left", (-1.0,), "at least the present time"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(to, times, words):
    with pytest.raises(ValueError, match=words):
        load_scene(CONTENT).build().run_sensitivity(times, ["P1"], [to])


def test_natural_modes_of_a_start_move_their_farthest_coordinate_by_a_metre():
    simulation = load_scene(small_sheet(nodes=(3, 3), arms={"links": 2})).build()
    at = simulation.operating_point()
    n = len(at.model.free)
    shapes = start_modes(at, 4)
    np.testing.assert_allclose(np.abs(shapes[: at.model.n_free_nodes]).max(axis=0), 1.0)
    names = ["start.position.mode_2", f"start.velocity.mode_{n}", "start.position.mode_1"]
    start = StartColumns(at, names)
    assert start.units == ("m", "m/s", "m")
    np.testing.assert_allclose(start.q[:, [0, 2]], shapes[:, [1, 0]], atol=1e-6)
    assert start.u[:, 1].any() and not start.q[:, 1].any()
    for name in ("start.velocity.mode_0", f"start.velocity.mode_{n + 1}"):
        with pytest.raises(ValueError, match=f"mode_1 to mode_{n}"):
            StartColumns(at, [name])


@pytest.mark.parametrize("drive", ["pressure", "torque"])
def test_a_scheduled_number_has_the_tangent_of_its_command(drive):
    size = {"pressure": 50e3, "torque": 0.02}[drive]
    inputs = [{"time": 0.0, drive: size}, {"time": 0.01, drive: [0.5 * size, 1.5 * size]}]
    content = small_sheet(
        nodes=(3, 3), arms={"links": 2, "drive": drive}, inputs=inputs, solver={"accuracy": 1e-4}
    )
    numbers = [f"inputs[1].{drive}[0]", f"inputs[0].{drive}"]
    commands = [f"{drive}.{arm}@{time}" for arm, time in (("left", 0.01), ("left", 0), ("right", 0))]
    run = load_scene(content).build().run_sensitivity([0.03], ["P1"], [*numbers, *commands], with_error=False)
    by_name = {name: run.values[0, :, k] for k, name in enumerate(run.to)}
    for number, same in ((numbers[0], ["left@0.01"]), (numbers[1], ["left@0", "right@0"])):
        expected = sum(by_name[f"{drive}.{one}"] for one in same)
        # Their equations are solved to a fraction of the asked accuracy.
        assert np.abs(by_name[number] - expected).max() < 1e-3 * np.abs(expected).max()
        assert np.abs(expected).max() > 0.0


def test_a_number_that_sizes_the_sheet_moves_the_start_of_a_run_that_begins_there_and_of_no_other():
    simulation = load_scene(small_sheet()).build()
    first = simulation.run_sensitivity([0.0], of=["P1"], to=["lattice.size[0]"])
    np.testing.assert_allclose(first.values[0].ravel(), [1.0, 0.0, 0.0], atol=1e-9)
    simulation.advance_to(0.05)
    later = simulation.run_sensitivity([0.05], of=["P1"], to=["lattice.size[0]"])
    np.testing.assert_allclose(later.values[0].ravel(), 0.0, atol=1e-12)


def test_a_stated_error_never_falls_along_a_run():
    simulation = load_scene(small_sheet()).build()
    times = np.linspace(0.0, 0.3, 31)
    error = simulation.run_sensitivity(times, of=["P1"], to=["effects.springs.stiffness"]).error
    assert (np.diff(error, axis=0) >= 0.0).all() and error[-1].max() > 0.0
    assert error[1].max() < error[-1].max()

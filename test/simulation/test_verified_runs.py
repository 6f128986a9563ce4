"""A verified run reports the measured difference from a finer solution that gets the same commands."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.cli.main import main
from ldcs_ros.errors import SceneError, SolverError
from ldcs_ros.simulation.verification import VerifiedSimulation
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin

SCENE = {
    "lattice": {"size": [0.14, 0.14, 0.007], "nodes": [4, 3], "mass": 0.1},
    "points": {"P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs", "law": "axial", "stiffness": 300.0, "damping": 1.0},
        {"type": "gravity"},
        {"type": "clamp", "edge": "x_min"},
        {"type": "wrench"},
    ],
    "solver": {"accuracy": 1e-4},
}


def test_the_measured_error_is_the_distance_from_a_run_at_a_tenth():
    scene = load_scene(SCENE)
    verified, plain, finer = scene.build(verify=True), scene.build(), scene.with_accuracy(1e-5).build()
    largest = 0.0
    for step in range(1, 6):
        for simulation in (verified, plain, finer):
            simulation.inputs.set_wrench("P1", force=(0.0, 0.0, 0.02 * step))
            simulation.advance_to(0.05 * step)
        gap = plain.state.position - finer.state.position
        largest = max(largest, float(np.linalg.norm(gap, axis=1).max()))
    # The first solution is what it is without the second one.
    np.testing.assert_array_equal(verified.state.position, plain.state.position)
    assert largest > 0.0
    assert verified.statistics.error_estimate == largest


def test_a_verified_run_resumes_with_both_solutions():
    simulation = load_scene(SCENE).build(verify=True)
    simulation.advance_to(0.1)
    state = simulation.state
    simulation.advance_to(0.2)
    first = simulation.state.position.copy(), simulation.statistics.error_estimate
    simulation.reset(state)
    simulation.advance_to(0.2)
    np.testing.assert_array_equal(simulation.state.position, first[0])
    assert simulation.statistics.error_estimate == first[1]


def test_states_of_plain_runs_and_fixed_steps_are_refused():
    scene = load_scene(SCENE)
    simulation = scene.build(verify=True)
    simulation.advance_to(0.05)
    position = simulation.state.position.copy()
    with pytest.raises(ValueError, match="without verification"):
        simulation.reset(scene.build().state)
    np.testing.assert_array_equal(simulation.state.position, position)
    with pytest.raises(SolverError, match="fixed step"):
        scene.edited(solver={"integrator": "trbdf2", "dt": 1e-3}).build(verify=True)


def test_simulate_verify_prints_the_measured_error(capsys):
    assert main(["simulate", "single_spring", "--duration", "0.2", "--verify"]) == 0
    said = capsys.readouterr().out
    assert "measured error" in said
    # An accuracy of 1e-7 m in time is useless on a lattice that is off by a millimetre.
    assert "lattice's own: about" in said
    assert main(["simulate", "single_spring", "--duration", "0.2"]) == 0
    assert "estimated error" in capsys.readouterr().out


def test_settling_keeps_both_solutions_together():
    simulation = load_scene(SCENE).build(verify=True)
    simulation.settle()
    simulation.advance_to(simulation.time + 0.05)
    assert simulation.statistics.error_estimate < 1e-6


def test_a_scene_may_ask_to_be_verified():
    scene = load_scene({**SCENE, "solver": {"accuracy": 1e-4, "verify": True}})
    assert isinstance(scene.build(), VerifiedSimulation)
    assert isinstance(scene.with_accuracy(1e-5).build(), VerifiedSimulation)
    with pytest.raises(SceneError, match=r"expected true or false @ .*solver.verify"):
        load_scene({**SCENE, "solver": {"verify": "yes please"}})
    with pytest.raises(SceneError, match="fixed step has no accuracy"):
        load_scene({**SCENE, "solver": {"integrator": "trbdf2", "dt": 1e-3, "verify": True}})


def test_a_bag_holds_the_measured_error(tmp_path):
    twin = Twin(load_scene({**SCENE, "solver": {"accuracy": 1e-4, "verify": True}}))
    recorder = Recorder(tmp_path / "bag", twin)
    twin.sinks.append(recorder)
    twin.advance_to(0.1)
    measured = twin.simulation.statistics.error_estimate
    recorder.close()
    texts = read_bag(tmp_path / "bag").custom_data
    assert texts["verify"] == "true" and float(texts["measured_error"]) == measured > 0.0

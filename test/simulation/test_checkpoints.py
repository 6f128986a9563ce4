"""A state goes back to where it was made, figures of the run included, and nowhere else."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from ldcs_ros import load_scene


def test_a_reset_to_a_state_restores_the_statistics_but_for_the_wall_time():
    simulation = load_scene("single_spring").build()
    simulation.advance_to(0.2)
    state, before = simulation.state, simulation.statistics.as_dict()
    simulation.advance_to(1.0)
    after = simulation.statistics.as_dict()
    assert after["steps"] > before["steps"] and after["evaluations"] > before["evaluations"]
    simulation.reset(state)
    again = simulation.statistics.as_dict()
    assert {**again, "wall_time": 0.0} == {**before, "wall_time": 0.0}
    simulation.advance_to(1.0)
    assert {**simulation.statistics.as_dict(), "wall_time": 0.0} == {**after, "wall_time": 0.0}


@pytest.mark.parametrize("other", ["paper", "paper_no_load"])
def test_a_foreign_state_is_refused_before_anything_changes(other):
    simulation = load_scene("arc").build()
    simulation.advance_to(0.1)
    foreign = load_scene(other).build()
    foreign.advance_to(0.05)
    before, figures = simulation.state, simulation.statistics.as_dict()
    with pytest.raises(ValueError, match="reset: got a state that this simulation did not have"):
        simulation.reset(foreign.state)
    assert simulation.time == 0.1 and simulation.statistics.as_dict() == figures
    np.testing.assert_array_equal(simulation.state.position, before.position)
    simulation.advance_to(0.15)
    assert np.isfinite(simulation.state.position).all()


def test_a_state_of_another_lattice_is_refused_with_its_number_of_nodes():
    def cell(nodes):
        springs = {"type": "springs", "stiffness": 100.0, "damping": 1.0}
        effects = [springs, {"type": "gravity"}, {"type": "clamp", "edge": "x_min"}]
        lattice = {"size": [0.1, 0.1, 0.01], "nodes": [nodes, 2], "mass": 0.05}
        return load_scene({"lattice": lattice, "effects": effects}).build()

    with pytest.raises(
        ValueError, match=r"one of 12 nodes, expected one of its own scene \(8 nodes, esdirk43\)"
    ):
        cell(2).reset(cell(3).state)


@pytest.mark.parametrize("verify", [False, True], ids=["plain", "verified"])
def test_a_pickled_simulation_goes_on_to_the_bit(verify):
    # As a worker of a process pool, or a file of a long run, gets it.
    simulation = load_scene("rig").build(verify=verify)
    simulation.advance_to(0.03)
    other = pickle.loads(pickle.dumps(simulation))
    for one in (simulation, other):
        one.inputs.set_pressure([50e3, 90e3])
        one.advance_to(0.06)
    np.testing.assert_array_equal(other.state.position, simulation.state.position)
    assert other.statistics.steps == simulation.statistics.steps
    assert other.inputs is not simulation.inputs

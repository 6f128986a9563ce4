"""What the Rosenbrock-W, exponential and reference methods promise beside their order."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.errors import SolverError
from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.integrators.rosenbrock_w import ALPHA, COUPLING, EMBEDDED, WEIGHTS


def linear_arc(**solver):
    content = load_scene("arc").content
    content["effects"][0]["law"] = "axiswise"
    return load_scene({**content, "solver": solver})


def test_the_rosenbrock_method_meets_the_conditions_of_order_three_for_any_matrix():
    one = np.ones(4)
    alpha, gamma = ALPHA @ one, COUPLING @ one
    conditions = {
        1.0: one, 1 / 2: alpha, 1 / 3: alpha**2, 1 / 6: ALPHA @ alpha,
    }  # fmt: skip
    for value, tree in conditions.items():
        assert WEIGHTS @ tree == pytest.approx(value, abs=1e-14)
    # What a wrong matrix brings in must vanish term by term.
    for tree in (gamma, ALPHA @ gamma, COUPLING @ alpha, COUPLING @ gamma):
        assert WEIGHTS @ tree == pytest.approx(0.0, abs=1e-14)
    assert EMBEDDED @ one == pytest.approx(1.0) and EMBEDDED @ alpha == pytest.approx(1 / 2)
    np.testing.assert_allclose(ALPHA[-1] + COUPLING[-1], WEIGHTS, atol=1e-14)  # stiffly accurate


def test_the_rosenbrock_method_keeps_factors():
    simulation = load_scene("arc").build().scene
    content = simulation.content
    simulation = load_scene({**content, "solver": {"integrator": "rosenbrock_w", "accuracy": 1e-6}}).build()
    simulation.advance_to(0.5)
    assert simulation.statistics.factorisations < 0.8 * simulation.statistics.steps


def test_the_exponential_method_is_exact_for_constant_loads_at_any_step():
    content = load_scene("single_spring").content
    reference = load_scene(content).with_accuracy(1e-10).build()
    simulation = load_scene({**content, "solver": {"integrator": "exponential", "dt": 0.5}}).build()
    for twin in (reference, simulation):
        twin.advance_to(0.5)
    np.testing.assert_allclose(simulation.state.position, reference.state.position, atol=2e-10)
    assert simulation.statistics.steps == 1


def test_the_exponential_method_agrees_with_the_default_one_on_a_driven_sheet():
    reference, simulation = linear_arc(accuracy=1e-8).build(), linear_arc(integrator="exponential").build()
    for time in (0.1, 0.5, 1.5):
        reference.advance_to(time)
        simulation.advance_to(time)
        np.testing.assert_allclose(simulation.state.position, reference.state.position, atol=1e-6)


@pytest.mark.parametrize("scene", ["arc", "paper"])
def test_the_exponential_method_refuses_scenes_that_are_not_linear(scene):
    content = load_scene(scene).content
    with pytest.raises(SolverError, match=r"'springs' with law 'axial' is not linear.*integrator: auto"):
        load_scene({**content, "solver": {"integrator": "exponential"}}).build()
    content["effects"][0]["law"] = "axiswise"
    content["effects"].append({"type": "drag"})
    with pytest.raises(SolverError, match="is not linear"):
        load_scene({**content, "solver": {"integrator": "exponential"}}).build()


def test_scipys_radau_confirms_the_default_method_with_arms():
    content = load_scene("paper").content
    radau = load_scene({**content, "solver": {"integrator": "radau", "accuracy": 1e-6}}).build()
    ours = load_scene("paper").with_accuracy(1e-7).build()
    for twin in (radau, ours):
        twin.advance_to(0.08)
    np.testing.assert_allclose(radau.state.position, ours.state.position, atol=1e-6)


@pytest.mark.parametrize("name", [name for name in INTEGRATORS if name not in ("exponential", "radau")])
def test_a_run_with_any_method_goes_on_from_a_state_to_the_bit(name):
    content = load_scene("paper").content
    simulation = load_scene({**content, "solver": {"integrator": name, "accuracy": 1e-4}}).build()
    simulation.advance_to(0.002)
    state = simulation.state
    simulation.advance_to(0.003)
    there = simulation.state.position.copy()
    simulation.reset(state)
    simulation.advance_to(0.003)
    np.testing.assert_array_equal(simulation.state.position, there)


def test_damping_that_couples_the_modes_has_no_exact_flow():
    content = small_sheet(nodes=(4, 3))
    content["effects"] = [
        {"type": "springs", "law": "axiswise", "stiffness": 80.0, "damping": 0.5},
        {"type": "clamp"},
    ]
    even = {**content, "solver": {"integrator": "exponential", "dt": 1e-3}}
    simulation = load_scene(even).build()
    simulation.advance_to(2e-3)
    # Drives through five samples of a step are followed to degree four.
    assert simulation.integrator.order == 5
    # Stiffer on one side, and damped as on the other.
    lattice = {**content["lattice"], "regions": [{"box": [0.0, -0.07, 0.05, 0.07], "stiffness": 3.0}]}
    with pytest.raises(SolverError, match="in proportion to stiffness"):
        load_scene({**even, "lattice": lattice}).build().advance_to(2e-3)

"""The compiled force of all effects together is the sum of the effects' own forces."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.scene import load_scene
from ldcs_ros.study.problems import content_of

pytestmark = pytest.mark.skipif(not HAVE_NUMBA, reason="the kernel is compiled")


def model_of(name, *more):
    content = content_of(name)
    content["effects"] = [*content["effects"], *more]
    return load_scene(content).build()


def moved(model, seed):
    rng = np.random.default_rng(seed)
    q, u = model.reference_state()
    q += 1e-3 * rng.normal(size=q.size)
    u += rng.normal(size=u.size)
    model.prescribe(0.3, q, u)
    return q, u


CASES = {
    "springs and a load": ("arc", ()),
    "a material": ("arc_material", ()),
    "arms driven by torque": ("paper", ()),
    "arms driven by pressure on plates": ("rig", ()),
    "drag": ("rig", ({"type": "drag", "density": 1000.0},)),
    "a floor that the sheet lies in": ("paper", ({"type": "floor", "height": 0.0},)),
    "nothing holds it": ("free_flight", ()),
}


@pytest.mark.parametrize("case", CASES)
def test_the_compiled_force_is_the_sum_of_the_effects_forces(case):
    name, more = CASES[case]
    simulation = model_of(name, *more)
    if simulation.inputs.torque is not None:
        simulation.inputs.set_torque([0.1, -0.2])
    if simulation.inputs.pressure is not None:
        simulation.inputs.set_pressure([40e3, 90e3])
    model, held = simulation.model, simulation.inputs.held()
    assert is_covered(model)
    total = TotalForce(model)
    for seed in range(3):
        q, u = moved(model, seed)
        expected = model.force(0.3, q, u, held)
        assert np.abs(total(0.3, q, u, held)[model.free] - expected).max() <= 1e-11 * np.abs(expected).max()


def test_a_wrench_with_axes_of_the_base_is_a_constant_force():
    simulation = model_of("paper")
    simulation.inputs.set_wrench("P1_aligned", force=(0.1, -0.2, 0.3))
    model, held = simulation.model, simulation.inputs.held()
    q, u = moved(model, 0)
    expected = model.force(0.3, q, u, held)
    assert (
        np.abs(TotalForce(model)(0.3, q, u, held)[model.free] - expected).max()
        <= 1e-11 * np.abs(expected).max()
    )


def test_a_wrench_that_turns_with_the_sheet_is_not_taken_for_constant():
    simulation = model_of("paper")
    simulation.inputs.set_wrench("P1", force=(0.1, -0.2, 0.3))
    assert TotalForce(simulation.model).steady(simulation.inputs.held()) is None


def test_a_model_with_another_spring_law_is_left_to_its_effects():
    content = content_of("arc")
    content["effects"][0]["law"] = "corotational"
    assert not is_covered(load_scene(content).build().model)

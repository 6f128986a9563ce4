"""The bordered band is the same matrix as the dense one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.integrators.implicit.system import LinearSystem


@pytest.mark.parametrize("scene", ["paper", "arc", "free_flight", "rig", "single_spring"])
def test_a_solve_inverts_the_dense_symmetric_matrix(scene):
    simulation = load_scene(scene).build()
    simulation.advance_to(0.05)
    model, held, h = simulation.model, simulation.inputs.held(), 0.01
    state = simulation.motion()
    by_position, by_rate = model.jacobian(state.time, state.q, state.u, held, positive_definite=False)
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    dense = np.zeros((len(model.free), len(model.free)))
    np.add.at(dense, (rows[used], columns[used]), -h * (by_rate + h * by_position)[used])
    dense = 0.5 * (dense + dense.T)
    blocks = model.inertia(state.q)
    dense += block_diag(np.diag(model.mass), *([] if blocks is None else blocks))
    right = np.random.default_rng(0).normal(size=len(model.free))
    factors = LinearSystem(model).factor(state.time, state.q, state.u, held, h)
    np.testing.assert_allclose(dense @ factors.solve(right), right, atol=1e-8)


def test_an_indefinite_matrix_falls_back_to_its_stable_part():
    simulation = load_scene("arc").build()
    model = simulation.model
    q, u = model.reference_state()
    q.reshape(-1, 3)[:, :] *= 0.5  # squeezed to half: the exact stiffness has negative directions
    model.prescribe(0.0, q, u)
    factors = LinearSystem(model).factor(0.0, q, u, simulation.inputs.held(), 10.0)
    right = np.ones(len(model.free))
    assert right @ factors.solve(right) > 0.0


def test_many_right_sides_are_solved_in_single_precision_and_none_is_divided_by_zero():
    simulation = load_scene(small_sheet(nodes=(4, 3), arms={"links": 2})).build()
    model, held = simulation.model, simulation.inputs.held()
    factors = LinearSystem(model).factor(0.0, *model.reference_state(), held, 0.01)
    right = np.random.default_rng(0).normal(size=(len(model.free), 8))
    right[:, 3] = 0.0
    right[:, 4] *= 1e30
    expected = factors.solve(right)
    found = factors.solve(right, single=True)
    largest = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected).max(axis=0) <= 1e-4 * largest).all() and not found[:, 3].any()

"""Every effect of the table: force against energy, Jacobian against force."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.effects import EFFECTS
from ldcs_ros.physics.inputs import NO_INPUTS, HeldCommands, Wrench

from .conftest import CASES

STEP = (
    1e-6  # of the central differences: truncation 1e-12 of the third derivative, rounding 1e-10 of the force
)


def test_every_effect_of_the_table_is_checked_here():
    assert {name for name, _ in CASES.values()} == set(EFFECTS)


@pytest.mark.parametrize(
    "case", [case for case in CASES if case not in ("clamp", "driven_edges", "drag", "wrench")]
)
def test_force_is_minus_the_energy_gradient(case, make_model, general_motion):
    model = make_model(case, "gravity") if case.startswith(("payload", "arms")) else make_model(case)
    q, u = general_motion(model)
    force = model.force(0.0, q, 0.0 * u, NO_INPUTS)
    assert np.abs(force).max() > 0.0
    # Along directions at random, in which every coordinate counts.
    for way in np.random.default_rng(1).normal(size=(4, q.size)):
        ahead, before = (model.potential_energy(0.0, q + sign * STEP * way) for sign in (1.0, -1.0))
        assert force @ way == pytest.approx((before - ahead) / (2 * STEP), abs=1e-6 * np.abs(force).max())


@pytest.mark.parametrize("case", [case for case in CASES if case not in ("clamp", "driven_edges", "wrench")])
def test_jacobian_is_the_slope_of_the_force(case, make_model, general_motion):
    model = make_model(case)
    q, u = general_motion(model)
    by_position, by_rate = model.jacobian(0.0, q, u, NO_INPUTS, positive_definite=False)
    # Along directions at random, in which every entry counts.
    ways = np.random.default_rng(1).normal(size=(4, q.size))
    for values, force, at in (
        (by_position, lambda x: model.force(0.0, x, u, NO_INPUTS), q),
        (by_rate, lambda x: model.force(0.0, q, x, NO_INPUTS), u),
    ):
        slopes = np.array([(force(at + STEP * way) - force(at - STEP * way)) / (2 * STEP) for way in ways])
        dense = np.zeros((q.size, q.size))
        np.add.at(dense, model.jacobian_pattern, values)
        np.testing.assert_allclose(ways @ dense.T, slopes, atol=1e-6 * max(np.abs(slopes).max(), 1e-3))


@pytest.mark.parametrize("case", ["springs axial", "springs corotational", "arms torque", "floor"])
def test_the_definite_part_of_a_jacobian_has_no_energy_source(case, make_model, general_motion):
    model = make_model(case)
    for seed in range(3):
        q, u = general_motion(model, seed)
        for values in model.jacobian(0.0, q, u, NO_INPUTS, positive_definite=True):
            dense = np.zeros((len(model.free), len(model.free)))
            np.add.at(dense, model.jacobian_pattern, values)
            eigenvalues = np.linalg.eigvalsh(0.5 * (dense + dense.T))
            assert eigenvalues.max() <= 1e-9 * max(np.abs(eigenvalues).max(), 1e-12)


@pytest.mark.parametrize(
    "case", ["springs axial", "springs axiswise", "springs corotational", "arms torque", "drag"]
)
def test_dashpots_only_remove_energy(case, make_model, general_motion):
    model = make_model(case)
    for seed in range(5):
        q, u = general_motion(model, seed)
        damping = model.force(0.0, q, u, NO_INPUTS) - model.force(0.0, q, 0.0 * u, NO_INPUTS)
        if case.startswith("arms"):
            # Coriolis forces are quadratic in the rates and do no work with the changing mass matrix: take
            # the odd part.
            damping = 0.5 * (
                damping - (model.force(0.0, q, -u, NO_INPUTS) - model.force(0.0, q, 0.0 * u, NO_INPUTS))
            )
        assert damping @ u < 0.0


def test_a_driven_edge_moves_at_the_rate_of_its_place(make_model):
    model = make_model("driven_edges")
    h = 1e-6
    for time in (0.0, 0.02, 0.3, 0.7, 0.999, 1.5):
        places = []
        for t in (time - h, time + h, time):
            q, u = model.reference_state()
            model.prescribe(t, q, u)
            places.append(q)
        # Smoothstep has a corner in its slope's slope at 0 and 1: 6 h of error there.
        np.testing.assert_allclose(u, (places[1] - places[0]) / (2 * h), atol=1e-5)


def test_a_wrench_is_statically_what_was_commanded(make_model, general_motion):
    model = make_model("wrench")
    q, u = general_motion(model)
    x = q.reshape(-1, 3)
    force, torque = (0.3, -0.1, 0.2), (0.01, 0.02, -0.015)
    for frame in ("P1_aligned", "node_top_2_1_aligned", "P1", "node_bottom_0_0"):
        pushes = model.force(0.0, q, u, HeldCommands(wrenches={frame: Wrench(force, torque)})).reshape(-1, 3)
        point, aligned = model.wrench.frame(frame)
        axes = np.eye(3) if aligned else point.frame(x)
        moment = np.cross(x - point.position(x), pushes).sum(axis=0)
        np.testing.assert_allclose(pushes.sum(axis=0), axes @ force, atol=1e-12)
        np.testing.assert_allclose(moment, axes @ torque, atol=1e-12)


def test_contact_pushes_and_never_pulls(make_model, general_motion):
    model = make_model("floor")
    q, _ = general_motion(model)
    for speed in (-10.0, -0.1, 0.0, 0.1, 10.0):
        u = np.zeros_like(q)
        u[2::3] = speed
        push = model.force(0.0, q, u, NO_INPUTS)[2::3]
        assert push.min() >= 0.0
    assert push.max() == 0.0  # leaving at 10 m/s: let go, not held back

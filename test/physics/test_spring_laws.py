"""What tells the three spring laws apart, and that compiled and plain kernels agree."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics import axial
from ldcs_ros.physics.axial import add_stiffness
from ldcs_ros.physics.inputs import NO_INPUTS
from ldcs_ros.physics.rotation import best_rotation


def _turned(model, angle=0.7):
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    q, _ = model.reference_state()
    x = q.reshape(-1, 3) @ turn.T + [0.1, 0.2, 0.3]
    spin, drift = np.array([0.4, -2.0, 1.0]), np.array([1.0, 2.0, -0.5])
    return x.ravel(), (np.cross(spin, x) + drift).ravel()


@pytest.mark.parametrize("law", ["axial", "corotational"])
def test_rigid_motion_gives_no_force(law, make_model):
    model = make_model(f"springs {law}")
    q, u = _turned(model)
    assert np.abs(model.force(0.0, q, u, NO_INPUTS)).max() < 1e-10


def test_rigid_rotation_strains_the_axiswise_law(make_model):
    model = make_model("springs axiswise")
    q, u = _turned(model)
    assert np.abs(model.force(0.0, q, 0.0 * u, NO_INPUTS)).max() > 1.0


@pytest.mark.parametrize("law", ["axial", "axiswise", "corotational"])
def test_springs_keep_linear_momentum(law, make_model, general_motion):
    model = make_model(f"springs {law}")
    q, u = general_motion(model)
    force = model.force(0.0, q, u, NO_INPUTS).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("law", ["axial", "corotational"])
def test_springs_keep_angular_momentum(law, make_model, general_motion):
    model = make_model(f"springs {law}")
    q, u = general_motion(model)
    force = model.force(0.0, q, u, NO_INPUTS).reshape(-1, 3)
    # The regular part of the star's moment of inertia is 1e-12 of its trace.
    np.testing.assert_allclose(np.cross(q.reshape(-1, 3), force).sum(axis=0), 0.0, atol=1e-11)


def test_only_the_corotational_law_resists_pure_shear_between_layers_at_first_order(make_model):
    # A spring across its own axis has no first-order force under the axial law.
    stiff = {}
    for law in ("axial", "corotational"):
        model = make_model(f"springs {law}")
        q, _u = model.reference_state()
        bent = q.reshape(-1, 3).copy()
        bent[:, 2] += 0.5 * 2.0 * bent[:, 0] ** 2  # curvature 2 1/m
        stiff[law] = model.potential_energy(0.0, bent.ravel())
    assert stiff["corotational"] > stiff["axial"] > 0.0


def test_coincident_nodes_are_pushed_apart_along_the_rest_axis(make_model):
    model = make_model("springs axial")
    q, u = model.reference_state()
    a, b = model.lattice.springs[0]
    q.reshape(-1, 3)[b] = q.reshape(-1, 3)[a]
    force = model.force(0.0, q, u, NO_INPUTS).reshape(-1, 3)
    assert np.isfinite(force).all()
    by_position, _ = model.jacobian(0.0, q, u, NO_INPUTS, positive_definite=False)
    assert np.isfinite(by_position).all()


def test_compiled_and_whole_array_kernels_agree(make_model, general_motion):
    model = make_model("springs axial")
    term = model.terms[0]
    q, u = general_motion(model)
    parts = (q, u, term.a, term.b, term.rest_length, term.rest_axis, term.k, term.c)
    loop, whole = np.zeros(q.size), np.zeros(q.size)
    axial._add_force_loop(*parts, loop)
    axial._add_force_whole(*parts, whole)
    np.testing.assert_allclose(loop, whole, atol=1e-12)
    n = model.lattice.n_nodes
    for positive_definite in (False, True):
        tables = [[np.zeros((n + 2 * len(term.a), 3, 3)) for _ in range(2)] for _ in range(2)]
        axial._fill_jacobian_loop(*parts, positive_definite, False, n, *tables[0])
        axial._fill_jacobian_whole(*parts, positive_definite, False, n, *tables[1])
        np.testing.assert_allclose(tables[0], tables[1], atol=1e-9)


def test_the_best_rotation_of_a_mirrored_set_is_proper():
    random = np.random.default_rng(3)
    for flip in (1.0, -1.0, 0.0):
        m = random.normal(size=(3, 3)) @ np.diag([1.0, 1.0, flip])
        rotation = np.empty((3, 3))
        best_rotation(m, rotation)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        u, _, vt = np.linalg.svd(m)
        best = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
        assert np.trace(rotation.T @ m) == pytest.approx(np.trace(best.T @ m))


def test_a_stiffness_goes_to_the_slots_of_its_blocks_and_nowhere_else():
    random = np.random.default_rng(2)
    q, weight = random.normal(size=9), np.array([2.0, 3.0])
    a, b = np.array([0, 1]), np.array([1, 2])
    q[6:] = q[3:6]  # the second spring has lost its length: it keeps the axis at rest
    rest_axis = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])
    slots, matrix = np.roll(np.arange(42), 7).reshape(2, 21), np.zeros(42)
    left_out = slots[0, 4], slots[1, 13]
    slots[0, 4] = slots[1, 13] = -1  # entries that the matrix has not
    first = (q[3:6] - q[:3]) / np.linalg.norm(q[3:6] - q[:3])
    add_stiffness(q, a, b, np.ones(2), rest_axis, weight, slots, matrix)
    lower = np.tril_indices(3)
    for s, n in enumerate((first, rest_axis[1])):
        block = weight[s] * np.outer(n, n)
        values = np.concatenate([block[lower], block[lower], -block.ravel()])
        kept = slots[s] >= 0
        np.testing.assert_allclose(matrix[slots[s][kept]], values[kept], atol=1e-15)
    assert not matrix[list(left_out)].any()

"""Kernels with the tables of a scene, executed by Python on small sheets, against formulas of dense matrices.

`test_kernels.py` runs this file with NUMBA_DISABLE_JIT: no kernel is compiled for the arguments of a test.
"""

from __future__ import annotations

import numpy as np
import pytest
from dense_sheet import ARMS, DRAG, FLOOR, dense_mass, dense_stage, loose, moved, sheet
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from ldcs_ros.integrators.implicit import (
    bordered_kernel,
    dirk_kernel,
)
from ldcs_ros.integrators.implicit.banded import Band
from ldcs_ros.integrators.implicit.block_tridiagonal import BlockTridiagonal
from ldcs_ros.integrators.implicit.linear_kernel import LinearKernel
from ldcs_ros.integrators.implicit.linearisation import Linearisation
from ldcs_ros.integrators.implicit.nested_dissection import Dissection
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.kernels.manifold_step import fill_projection, manifold_step
from ldcs_ros.physics.kernels.total_force import TotalForce


@pytest.mark.parametrize("nodes", [(4, 3), (3, 4), (4, 4), (5, 3)])
@pytest.mark.parametrize(
    ("storage", "accuracy"), [(Band, 1e-9), (BlockTridiagonal, 1e-3), (Dissection, 1e-3)]
)
def test_factors_solve_the_dense_matrix(nodes, storage, accuracy):
    simulation = sheet(nodes=nodes)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    factors = LinearSystem(model, storage).factor(0.0, q, u, held, 2e-3)
    right = random.normal(size=(len(model.free), 2))
    expected = np.linalg.solve(dense_stage(model, q, u, held, 2e-3), right)
    for solution in (factors.solve(right), np.stack([factors.solve(column) for column in right.T], axis=1)):
        assert np.abs(solution - expected).max() <= accuracy * np.abs(expected).max()


@pytest.mark.parametrize("nodes", [(8, 5), (11, 3)])
def test_a_dissection_with_several_fronts_solves_the_dense_matrix(nodes):
    simulation = sheet(nodes=nodes)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    system = LinearSystem(model, Dissection)
    factors = system.factor(0.0, q, u, held, 2e-3)
    assert len(factors.parts[0]._at.fronts) >= 3
    right = random.normal(size=len(model.free))
    expected = np.linalg.solve(dense_stage(model, q, u, held, 2e-3), right)
    assert np.abs(factors.solve(right) - expected).max() <= 1e-3 * np.abs(expected).max()


def test_compiled_solves_apply_rotations_border_and_scale():
    simulation = sheet(nodes=(4, 3))
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    for storage, tables, solve in (
        (Band, None, dirk_kernel.solve_turned),
        (BlockTridiagonal, bordered_kernel.factor_tables, bordered_kernel.solve_factors),
    ):
        system = LinearSystem(model, storage)
        factors = system.factor(0.0, q, u, held, 2e-3, corotated=True)
        if tables is None:
            kernel = dirk_kernel.DirkKernel(model, system, np.ones(len(model.free)))
            table = kernel.tables(factors)
        else:
            table = tables(system, factors)
        turns = Rotation.from_rotvec(random.normal(size=(2 * len(system.columns), 3))).as_matrix()
        for shape, scale in ((turns.reshape(2, -1, 3, 3), 1.0), (turns.reshape(2, -1, 3, 3), 0.7)):
            # W = G W0 H^T for the nodes, the arms' part in the same axes.
            g, h = (np.eye(len(model.free)) for _ in range(2))
            n = len(system.order)
            for matrix, blocks in ((g, shape[0]), (h, shape[1])):
                matrix[np.ix_(system.order, system.order)] = block_diag(*blocks)
                matrix[n:, n:] = np.eye(len(model.free) - n)
            right = random.normal(size=len(model.free))
            plain = h @ (scale * factors.solve(g.T @ right))
            solution = right.copy()
            solve(table, np.ascontiguousarray(shape), scale, solution)
            assert np.abs(solution - plain).max() <= 1e-5 * np.abs(plain).max()


def test_rotations_of_columns_follow_a_turned_sheet():
    simulation = sheet()
    model = simulation.model
    q, u, _ = moved(simulation)
    system = LinearSystem(model, BlockTridiagonal)
    factors = system.factor(0.0, q, u, simulation.inputs.held(), 2e-3, corotated=True)
    turn, spin = Rotation.from_rotvec([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -3.0])
    n = model.lattice.n_nodes
    turned = q.copy()
    turned[: 3 * n] = turn.apply(q[: 3 * n].reshape(-1, 3)).ravel()
    rates = np.cross(spin, turned[: 3 * n].reshape(-1, 3)).ravel()
    u[: 3 * n] = rates
    turns = np.empty((2, len(system.columns), 3, 3))
    bordered_kernel.fill_both_rotations(
        bordered_kernel.factor_tables(system, factors), n, 1e-4, turned, u, turns
    )
    assert np.abs(turns[0] - turn.as_matrix()).max() < 1e-12
    later = (Rotation.from_rotvec(1e-4 * spin) * turn).as_matrix()
    assert np.abs(turns[1] - later).max() < 1e-6


@pytest.mark.parametrize("links", [1, 2])
def test_the_residual_is_the_models_force_less_its_momentum(links):
    simulation = sheet(DRAG, FLOOR, arms={**ARMS, "links": links})
    simulation.inputs.set_torque([0.02, -0.01])
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    a = random.normal(size=len(model.free))
    kernel = dirk_kernel.DirkKernel(model, LinearSystem(model), np.ones(len(model.free)))
    residual, force = np.empty(len(a)), np.empty(len(q))
    drive, steady = kernel.force.drive(0.0, held), kernel.force.steady(held)
    table = kernel.sheet
    bordered_kernel.fill_residual(
        table.force,
        drive,
        steady,
        table.scratch,
        table.free,
        table.mass,
        q,
        u,
        a,
        table.inertia,
        force,
        residual,
    )
    expected = model.force(0.0, q, u, held) - dense_mass(model, q) @ a
    assert np.abs(residual - expected).max() <= 1e-10 * np.abs(expected).max()
    bordered_kernel.times_mass(table.inertia, table.mass, a, table.mass.size)
    assert np.abs(a - dense_mass(model, q) @ np.linalg.solve(dense_mass(model, q), a)).max() < 1e-9
    assert np.abs(model.force(0.0, q, u, held) - a - residual).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("make", [lambda: sheet(DRAG, FLOOR, accuracy=1e-5), lambda: loose(accuracy=1e-5)])
def test_stages_at_once_are_the_effects_called_one_by_one(make):
    runs = [make(), make()]
    runs[1].integrator.call_effects_one_by_one()
    for run in runs:
        if run.inputs.torque is not None:
            run.inputs.set_torque([0.05, -0.02])
        else:
            q, u, _ = moved(run)
            nodes = slice(0, 3 * run.lattice.n_nodes)
            run.start_from(q[nodes].reshape(-1, 3), 3.0 * u[nodes].reshape(-1, 3))
        run.advance_to(0.012)
    assert runs[0].integrator.kernel is not None
    assert np.abs(runs[0].state.position - runs[1].state.position).max() < 1e-9
    for name in ("steps", "rejected_steps", "evaluations", "factorisations", "solves"):
        assert getattr(runs[0].statistics, name) == getattr(runs[1].statistics, name), name
    estimates = [run.statistics.error_estimate for run in runs]
    assert estimates[0] == pytest.approx(estimates[1], rel=1e-3)
    motion, held = runs[0].last_step.right, runs[0].inputs.held()
    rate = runs[0].integrator.damping_rate(motion, held)
    assert rate == pytest.approx(runs[0].model.damping_rate(motion, held), rel=1e-6)


@pytest.mark.parametrize("links", [1, 2])
def test_a_step_on_a_manifold_leaves_no_projected_residual(links):
    simulation = sheet(DRAG, nodes=(3, 3), arms={**ARMS, "links": links})
    simulation.inputs.set_torque([0.05, 0.02])
    model, held, h = simulation.model, simulation.inputs.held(), 2e-3
    mean, still = model.reference_state()
    random, free, n = np.random.default_rng(13), model.free, len(mean)
    scale, decoder = np.array([1.0, 0.5]), np.zeros((5, n))
    decoder[:, free] = random.normal(size=(5, len(free))) * [[1.0], [1.0], [0.3], [0.3], [0.3]]
    lead = 11.0 / 6.0
    stiffness = dense_stage(model, mean, still, held, h / lead) * (lead / h) ** 2
    projection = np.zeros((2, n))
    projection[:, free] = np.linalg.pinv(decoder[:2, free].T) @ np.linalg.inv(stiffness)
    weights = np.zeros(n)
    weights[free[: model.n_free_nodes]] = model.mass

    def place(z):
        return mean + np.array([*z, z[0] * z[0], z[0] * z[1], z[1] * z[1]]) @ decoder

    zs = 1e-3 * np.array([[1.0, 2.0], [0.5, 1.5], [0.2, 1.0]])
    qs = np.stack([place(z) for z in zs])
    us = np.stack([(qs[0] - qs[1]) / h, (qs[1] - qs[2]) / h, (qs[1] - qs[2]) / h])
    old, guess, force = (
        (zs.copy(), qs.copy(), us.copy()),
        3.0 * zs[0] - 3.0 * zs[1] + zs[2],
        TotalForce(model),
    )
    iterations, unforeseen = manifold_step(
        force.tables, force.drive(0.0, held), force.steady(held), force.scratch, weights, mean, decoder, projection,
        scale, zs, qs, us, h, 1e-9, 20,
    )  # fmt: skip
    assert 0 < iterations <= 8
    assert np.array_equal(zs[1:], old[0][:2]) and np.array_equal(qs[1:], old[1][:2])
    np.testing.assert_allclose(qs[0], place(zs[0]), atol=1e-15)
    u = (11.0 * qs[0] - 18.0 * old[1][0] + 9.0 * old[1][1] - 2.0 * old[1][2]) / (6.0 * h)
    a = (11.0 * u - 18.0 * old[2][0] + 9.0 * old[2][1] - 2.0 * old[2][2]) / (6.0 * h)
    np.testing.assert_allclose(us, [u, *old[2][:2]], atol=1e-12)
    residual = model.force(0.0, qs[0], u, held) - dense_mass(model, qs[0]) @ a[free]
    assert np.abs(projection[:, free] @ residual * scale).max() < 1e-8
    assert unforeseen == pytest.approx(np.linalg.norm(scale * (zs[0] - guess)))
    assert unforeseen > 1e-5
    refused = manifold_step(
        force.tables, force.drive(0.0, held), force.steady(held), force.scratch, weights, mean, decoder, projection,
        scale, zs, qs, us, h, 1e-9, 1,
    )  # fmt: skip
    assert refused == (-2, np.inf)


def test_a_projection_is_the_mean_and_its_components_by_features_and_distances():
    random, r, leading, k, n, places = np.random.default_rng(5), 4, 3, 6, 11, 9
    z, metric = random.normal(size=r), random.uniform(0.5, 2.0, r)
    first, second = np.triu_indices(leading)
    features = np.concatenate([[1.0], z[:leading], z[first] * z[second]])
    fractions, differences = random.normal(size=(len(features), k)), random.normal(size=(places, k))
    at = random.normal(size=(places, r))
    components = random.normal(size=(k + 1, n)).astype(np.float32)
    found = np.empty(n, dtype=np.float32)
    fill_projection(z, leading, fractions, metric, at, differences, components, found)
    far = np.array([np.linalg.norm(place - z * metric) for place in at])
    expected = (features @ fractions - far @ differences) @ components[:k] + components[k]
    # Single precision, of sums whose terms reach some tens.
    np.testing.assert_allclose(found, expected, atol=2e-4)


@pytest.mark.parametrize("effects", [(), (DRAG, FLOOR)], ids=["arms", "arms, drag, floor"])
def test_compiled_stage_equations_are_those_of_the_matrices(effects):
    simulation = sheet(*effects)
    model, held = simulation.model, simulation.inputs.held()
    q, u, random = moved(simulation)
    n, h = len(model.free), 2e-3
    a, vectors = random.normal(size=n), random.normal(size=(3, 2, n))
    exact = Linearisation(model, np.ones(n))
    kernel = LinearKernel(simulation.integrator.kernel, exact)
    matrices = exact.at(0.0, q, u, a, held)
    position, rate, mass = (matrix.to_scipy().toarray() for matrix in matrices)
    stage = mass - h * rate - h * h * position
    kernel.linearise(0.0, q, u, a, held)
    found = np.zeros((2, n))
    kernel.balance(*vectors, found)
    expected = (position @ vectors[0].T + rate @ vectors[1].T - mass @ vectors[2].T).T
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
    for product, matrix in zip(kernel.transposed(vectors[0, 0]), (position, rate), strict=True):
        expected = matrix.T @ vectors[0, 0]
        np.testing.assert_allclose(product, expected, atol=1e-11 * np.abs(expected).max())
    system = simulation.integrator.kernel.system
    factors = system.factor(0.0, q, u, held, h, corotated=True)
    factors = system.turn(factors, 0.0, q, u, held, h)
    for transposed, matrix in ((False, stage), (True, stage.T)):
        solution = np.zeros((2, n))
        contraction = kernel.solve(factors, h, vectors[0].copy(), solution, 1e-8, 1.0, transposed=transposed)
        expected = np.linalg.solve(matrix, vectors[0].T).T
        assert 0.0 < contraction <= 1.0
        np.testing.assert_allclose(solution, expected, atol=1e-6 * np.abs(expected).max())

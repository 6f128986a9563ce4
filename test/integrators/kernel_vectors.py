"""The vector work of implicit steps, executed by Python, against formulas; `test_kernels.py` runs this file."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ldcs_ros.integrators import base, rkc2
from ldcs_ros.integrators.implicit import broyden, error_kernels, linearisation


def test_broydens_updates_are_those_of_dense_matrices():
    random = np.random.default_rng(4)
    n, reach = 7, np.linspace(1.0, 2.0, 7)
    system = np.eye(n) + 0.2 * random.normal(size=(n, n))
    x, updates, inverse, before = np.zeros(n), broyden.BroydenUpdates(reach), np.eye(n), None
    right = random.normal(size=n)
    for _ in range(6):
        residual = right - system @ x
        if before is not None:
            # The good update: s + H (r' - r) s^T D / (s^T D H (r - r')) H, in the norm of D = reach^2.
            s, change = before[0], inverse @ (before[1] - residual)
            inverse += np.outer(s - change, (s * reach**2) @ inverse) / ((s * reach**2) @ change)
        step = updates.step(residual.copy(), None if before is None else before[0])
        assert np.abs(step - inverse @ residual).max() < 1e-9
        before = step.copy(), residual
        x += step
    assert updates.count == 5
    assert np.abs(right - system @ x).max() < 0.05 * np.abs(right).max()


def test_an_update_that_would_amplify_rounding_is_left_out():
    s = np.array([1.0, 0.0])
    for along, kept in ((0.95, False), (0.85, True)):
        before, after, squares = np.empty((3, 2)), np.empty((3, 2)), np.empty(3)
        z = np.array([along, 0.3])
        assert broyden.extend_updates(s, np.ones(2), z, before, after, squares, 0) == kept
        expected = np.array([along, 0.3]) / (1.0 - along if kept else 1.0)
        assert z == pytest.approx(expected)
    assert not broyden.extend_updates(0.0 * s, np.ones(2), z, before, after, squares, 0)


def test_the_largest_value_counts_by_its_reach_and_is_infinite_for_no_number():
    assert broyden.largest(np.array([1.0, -3.0]), np.array([2.0, 0.5])) == 2.0
    assert broyden.largest(np.array([1.0, -3.0]), np.array([1.0, 0.5])) == 1.5
    assert broyden.largest(np.array([1.0, np.nan, 0.0]), np.ones(3)) == np.inf


def test_gmres_with_kept_factors_solves_the_matrix_of_now():
    random = np.random.default_rng(5)
    n, k = 12, 3
    exact = np.eye(n) + 0.1 * random.normal(size=(n, n))
    near = exact + 0.03 * random.normal(size=(n, n))

    class Kept:
        solves = 0

        def solve(self, right, *, single=False):
            self.solves += 1
            return np.linalg.solve(near, right)

    rows, columns = np.divmod(np.arange(n * n), n)
    starts = np.searchsorted(rows, np.arange(n + 1)).astype(np.int32)
    matrix = linearisation.SparseMatrix(starts, columns.astype(np.int32), exact.ravel())
    right = random.normal(size=(n, k))
    right[:, 2] = 0.0
    assert np.abs(matrix @ right - exact @ right).max() < 1e-12
    guess, kept = np.zeros((n, k)), Kept()
    weight = random.uniform(0.5, 2.0, n)
    solution, contraction = linearisation.solve_stage(
        matrix, kept, right - exact @ guess, guess, weight, 1e-6, 1.0
    )
    expected = np.linalg.solve(exact, right)
    assert np.abs(solution - expected).max() < 3e-6 * np.abs(expected).max()
    assert 0.0 < contraction < 0.3
    # Each direction leaves a part of the error that the contraction names.
    assert kept.solves <= 3 + np.log(1e-6) / np.log(contraction)
    matrices = tuple(
        linearisation.SparseMatrix(starts, columns.astype(np.int32), values.ravel())
        for values in (exact, near, np.diag(np.arange(n, dtype=float)))
    )
    q, u, a = random.normal(size=(3, n, k))
    result = np.ones((n, k))
    linearisation.add_balance(matrices, q, u, a, result)
    balance = 1.0 + exact @ q + near @ u - np.diag(np.arange(n, dtype=float)) @ a
    assert np.abs(result - balance).max() < 1e-12


def hermite(h, s):
    """Return the weights of q0, u0, a0, q1, u1, a1 in q, u and a of a quintic at the fraction s of a step."""
    powers = np.arange(6)

    def row(t, order):
        factors = np.ones(6)
        for k in range(order):
            factors *= powers - k
        return np.where(powers >= order, factors * t ** np.maximum(powers - order, 0), 0.0)

    ends = np.stack([row(t, order) for t in (0.0, h) for order in range(3)])
    return [row(s * h, order) @ np.linalg.inv(ends) for order in range(3)], np.linalg.inv(ends)[5]


def test_the_quintic_interpolates_both_ends():
    random = np.random.default_rng(6)
    h, s, free = 0.3, 0.37, np.array([4, 1, 2])
    q0, u0, q1, u1 = random.normal(size=(4, 5))
    a0, a1 = random.normal(size=(2, 3))
    q, u, a = np.zeros(5), np.zeros(5), np.zeros(3)
    error_kernels.interpolate(free, h, s, q0, u0, a0, q1, u1, a1, q, u, a)
    ends = np.stack([q0[free], u0[free], a0, q1[free], u1[free], a1])
    weights, highest = hermite(h, s)
    np.testing.assert_allclose([q[free], u[free], a], [w @ ends for w in weights], rtol=1e-9)
    assert q[0] == q[3] == 0.0
    bend = np.empty(3)
    base._bend(free, h, q0, u0, a0, q1, u1, a1, bend)
    np.testing.assert_allclose(bend, h**5 * (highest @ ends), rtol=1e-9)


def test_spins_turn_one_set_of_frames_into_the_next():
    random = np.random.default_rng(7)
    then = Rotation.from_rotvec(random.normal(size=(4, 3)))
    spins = random.normal(size=(4, 3))
    spins[3] = 0.0
    now = Rotation.from_rotvec(0.2 * spins) * then
    columns, found = np.array([2, 0, 3]), np.empty((3, 3))
    most = error_kernels.column_spins(now.as_matrix(), then.as_matrix(), columns, 0.2, found)
    np.testing.assert_allclose(found, spins[columns], atol=1e-9)
    assert most == pytest.approx(0.2 * np.linalg.norm(spins[columns], axis=1).max())


def test_vectors_rotate_by_rodrigues_formula():
    random = np.random.default_rng(8)
    spin, values = random.normal(size=(2, 3)), random.normal(size=8)
    order = np.array([3, 5, 4, 0, 1, 7])
    turned = values.copy()
    error_kernels.rotate_vectors(order, spin, 0.4, turned)
    for k in range(2):
        mine = order[3 * k : 3 * k + 3]
        np.testing.assert_allclose(turned[mine], Rotation.from_rotvec(0.4 * spin[k]).apply(values[mine]))
    assert turned[2] == values[2] and turned[6] == values[6]
    rates = np.zeros(8)
    error_kernels.subtract_spin(order, spin, values, rates)
    for k in range(2):
        mine = order[3 * k : 3 * k + 3]
        np.testing.assert_allclose(rates[mine], -np.cross(spin[k], values[mine]))
    still = values.copy()
    error_kernels.rotate_vectors(order, 0.0 * spin, 0.4, still)
    assert np.array_equal(still, values)


def test_lobattos_rule_gives_mean_and_slope_of_a_linear_forcing():
    # r(s) = 2 + 3 (s - 1/2) times s (1 - s), which Lobatto's rule integrates exactly: zero at both ends.
    def forcing(s):
        return (2.0 + 3.0 * (s - 0.5)) * s * (1.0 - s)

    points, weights = np.polynomial.legendre.leggauss(4)
    s = 0.5 + 0.5 * points
    mean, first = 0.5 * weights @ forcing(s), 0.5 * weights @ ((1.0 - s) * forcing(s))
    found, slope, moment = np.empty(1), np.empty(1), 0.17
    values = [np.array([forcing(point)]) for point in error_kernels.INNER]
    error_kernels.moments(*values, moment, found, slope)
    # The forcing mean + (s - 1/2) slope has the first moment that stages with `moment` for that of s give it.
    assert found[0] == pytest.approx(mean)
    assert 0.5 * mean + (moment - 0.25) * slope[0] == pytest.approx(first)


def test_a_stage_of_an_error_takes_the_stages_before_and_its_own_acceleration():
    random = np.random.default_rng(9)
    a, h, n = random.normal(size=(3, 3)), 0.2, 4
    e_q, e_u, own = random.normal(size=(3, n))
    errors, known = random.normal(size=(3, 3, n)), np.empty((2, n))
    error_kernels.known_part(a, 2, h, e_q, e_u, errors, known)
    np.testing.assert_allclose(known[0], e_q + h * (a[2, :2] @ errors[:2, 1]))
    np.testing.assert_allclose(known[1], e_u + h * (a[2, :2] @ errors[:2, 2]))
    error_kernels.finish_stage(2, 0.05, own, known, errors)
    rate = known[1] + 0.05 * own
    np.testing.assert_allclose(errors[2], [known[0] + 0.05 * rate, rate, own])


def test_a_stage_in_turning_axes_has_the_apparent_forces():
    random = np.random.default_rng(10)
    free, order, mass = np.arange(1, 8), np.array([0, 1, 2, 3, 4, 5]), random.uniform(1.0, 2.0, 6)
    spin, known = random.normal(size=(2, 3)), random.normal(size=(2, 7))
    q, u, force = np.zeros(9), np.zeros(9), np.zeros(7)
    error_kernels.apply_stage(free, order, spin, 0.3, 0.1, mass, known, q, u, force)
    for k in range(2):
        mine, w = slice(3 * k, 3 * k + 3), spin[k]
        turn = Rotation.from_rotvec(0.3 * w)
        e = known[0, mine] + 0.1 * known[1, mine]
        velocity = known[1, mine] + np.cross(w, e)
        # Coriolis' and the centrifugal acceleration: 2 w x e' + w x (w x e).
        apparent = 2.0 * np.cross(w, known[1, mine]) + np.cross(w, np.cross(w, e))
        np.testing.assert_allclose(q[free[mine]], turn.apply(e))
        np.testing.assert_allclose(u[free[mine]], turn.apply(velocity))
        np.testing.assert_allclose(force[mine], -mass[mine] * turn.apply(apparent))
    assert q[free[6]] == pytest.approx(known[0, 6] + 0.1 * known[1, 6])
    assert u[free[6]] == known[1, 6] and force[6] == 0.0 and q[0] == q[8] == 0.0


def test_distances_are_lengths_of_node_vectors():
    free = np.array([3, 4, 5, 7, 8, 12])
    values = np.array([3.0, 4.0, 0.0, 2.0, 2.0, 99.0])
    assert error_kernels.largest_distance(free, values, 5) == 5.0
    assert error_kernels.largest_distance(free, values[::-1].copy(), 5) == pytest.approx(
        np.sqrt(99.0**2 + 8.0)
    )
    values[1] = np.nan
    assert error_kernels.largest_distance(free, values, 5) == np.inf
    errors, c = np.zeros((3, 3, 6)), np.array([0.25, 0.75, 1.0])
    start = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 50.0])
    errors[2, 0, :5] = [0.0, 1.0, 0.0, 0.0, 0.0]
    errors[0, 0, 3:5] = [3.0, 4.0]
    # Of the second node: twice its 5 over a chord of zero; of the first: its chord alone.
    assert error_kernels.largest_bulge(free, 5, c, start, errors) == 10.0
    errors[0, 0] = 0.0
    assert error_kernels.largest_bulge(free, 5, c, start, errors) == pytest.approx(np.hypot(0.75, 0.25))
    errors[1, 0, 0] = 0.5
    assert error_kernels.largest_bulge(free, 5, c, start, errors) == pytest.approx(np.hypot(0.75, 0.75))


def test_the_embedded_error_is_the_weighted_sum_of_the_stages():
    random = np.random.default_rng(11)
    weights, reach = random.normal(size=4), np.array([1.0, 1.0, 0.2])
    rates, accelerations = random.normal(size=(2, 4, 3))
    defect, rate_defect = np.empty(3), np.empty(3)
    for h in (0.1, 20.0):
        found = error_kernels.embedded_error(
            h, weights, rates, accelerations, reach, 0.25, defect, rate_defect
        )
        position, rate = h * (weights @ rates), h * (weights @ accelerations)
        np.testing.assert_allclose([defect, rate_defect], [position, rate])
        largest = np.abs(position * reach).max(), np.abs(rate * reach).max()
        assert found == pytest.approx((max(largest[0], 0.25 * h * largest[1]), largest[1]))
    still = error_kernels.embedded_error(0.1, weights, rates, 0.0 * rates, reach, 0.25, defect, rate_defect)
    assert still == pytest.approx((np.abs(0.1 * (weights @ rates) * reach).max(), 0.0))
    rates[2, 1] = np.nan
    assert error_kernels.embedded_error(
        0.1, weights, rates, accelerations, reach, 0.25, defect, rate_defect
    ) == (np.inf, np.inf)


def test_a_chebyshev_stage_combines_its_two_predecessors():
    random = np.random.default_rng(12)
    start, near, far, push, first = random.normal(size=(5, 3))
    expected = (1.0 - 0.5 - 0.3) * start + 0.5 * near + 0.3 * far + 0.2 * push + 0.1 * first
    rkc2._combine(0.5, 0.3, 0.2, 0.1, start, near, far, push, first)
    np.testing.assert_allclose(far, expected)

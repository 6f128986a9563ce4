"""Designs of sweeps and Sobol indices against numbers that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.sweep import Design, Factor, SweepError, sobol_indices
from ldcs_ros.sweep.design import neighbour_order, parse_factor

BOX = (Factor("a", 0.0, 2.0), Factor("b", 10.0, 20.0), Factor("c", -1.0, 1.0))


def test_a_grid_has_every_combination_of_its_levels():
    samples = Design((Factor("a", 0.0, 1.0, 3), Factor("b", 5.0, 6.0, 2))).samples()
    assert samples.tolist() == [[0.0, 5.0], [0.0, 6.0], [0.5, 5.0], [0.5, 6.0], [1.0, 5.0], [1.0, 6.0]]


def test_a_latin_hypercube_has_one_sample_in_each_slice_of_each_factor():
    samples = Design(BOX, "latin", 20, seed=3).samples()
    for column, one in zip(samples.T, BOX, strict=True):
        assert sorted(np.floor(20 * (column - one.low) / (one.high - one.low)).astype(int)) == list(range(20))
    np.testing.assert_array_equal(samples, Design(BOX, "latin", 20, seed=3).samples())
    assert not np.array_equal(samples, Design(BOX, "latin", 20, seed=4).samples())


def test_saltellis_design_mixes_one_column_at_a_time():
    samples = Design(BOX, "sobol", 8).samples().reshape(5, 8, 3)
    a, b = samples[:2]
    for k, mixed in enumerate(samples[2:]):
        np.testing.assert_array_equal(mixed[:, k], b[:, k])
        np.testing.assert_array_equal(np.delete(mixed, k, axis=1), np.delete(a, k, axis=1))


def test_indices_of_a_polynomial_are_those_of_its_variances():
    # f = 3 a' + 2 b' + 4 a' c' with a', b', c' uniform in -1 ... 1: variances 9/3, 4/3 and 16/9, without a first of c.
    design = Design(BOX, "sobol", 512, seed=1)
    a, b, c = (design.samples() - [1.0, 15.0, 0.0]).T / np.array([[1.0], [5.0], [1.0]])
    found = sobol_indices(design, 3.0 * a + 2.0 * b + 4.0 * a * c)
    parts = np.array([3.0, 4.0 / 3.0, 16.0 / 9.0]) / (3.0 + 4.0 / 3.0 + 16.0 / 9.0)
    np.testing.assert_allclose(found.first, [parts[0], parts[1], 0.0], atol=0.05)
    np.testing.assert_allclose(found.total, [parts[0] + parts[2], parts[1], parts[2]], atol=0.05)
    assert (found.total_interval[0] <= found.total).all() and (found.total <= found.total_interval[1]).all()


def test_neighbours_follow_each_other():
    samples = Design((Factor("a", 0.0, 1.0, 6), Factor("b", 0.0, 1e5, 5))).samples()
    order = neighbour_order(samples)
    assert sorted(order) == list(range(30)) and order[0] == 0
    steps = np.abs(np.diff(samples[order] / [0.2, 0.25e5], axis=0)).sum(axis=1)
    assert steps.mean() < 1.3


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: Design(()), "one or more different"),
        (lambda: Design(BOX), "no number of levels, expected LOW..HIGH:LEVELS @ a"),
        (lambda: Design(BOX, "sobol", 100), "power of 2"),
        (lambda: Design((Factor("a", 1.0, 0.0, 2),)), "expected LOW..HIGH @ a"),
        (lambda: Design((Factor("a", 0.0, 1.0, 900), Factor("b", 0.0, 1.0, 900))), "810000 samples"),
        (lambda: parse_factor("a=1"), "expected PATH=LOW..HIGH:LEVELS"),
        (lambda: parse_factor("a=1..x:2"), "expected PATH=LOW..HIGH:LEVELS"),
        (lambda: sobol_indices(Design(BOX, "latin", 8), np.zeros(8)), "need the sampling 'sobol'"),
        (
            lambda: sobol_indices(Design(BOX, "sobol", 2), np.full(10, np.nan)),
            "10 of 10 samples have no value",
        ),
        (lambda: sobol_indices(Design(BOX, "sobol", 2), np.ones(10)), "the same at all samples"),
    ],
)
def test_what_does_not_fit_is_refused(make, expected):
    with pytest.raises(SweepError, match=expected):
        make()

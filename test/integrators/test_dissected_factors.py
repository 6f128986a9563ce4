"""The dissected storage holds the same matrix as the band."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.integrators.implicit import system as linear
from ldcs_ros.integrators.implicit.nested_dissection import Dissection
from ldcs_ros.physics.compiled import HAVE_NUMBA


def _simulation(scene, nodes, **springs):
    content = load_scene(scene).content
    content["lattice"]["nodes"] = nodes
    content["effects"][0].update(springs)
    return load_scene(content).build()


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba the band serves all lattices")
@pytest.mark.parametrize(
    ("scene", "nodes", "springs"),
    [
        ("arc", [9, 9], {}),
        ("arc", [4, 13], {}),
        ("arc", [14, 5], {}),
        ("free_flight", [9, 9], {}),
        ("paper", [11, 11], {}),
        ("paper", [9, 9], {"law": "corotational"}),
    ],
)
def test_a_dissected_sheet_is_solved_like_a_band(monkeypatch, scene, nodes, springs):
    simulation = _simulation(scene, nodes, **springs)
    simulation.advance_to(0.05)
    motion, held = simulation.motion(), simulation.inputs.held()
    right = np.random.default_rng(1).normal(size=len(simulation.model.free))
    solutions = []
    for size in (0, 10**9):
        monkeypatch.setattr(linear, "DISSECTED_SIZE", size)
        system = linear.LinearSystem(simulation.model)
        factors = system.factor(motion.time, motion.q, motion.u, held, 0.01, corotated=True)
        solutions.append(factors.solve(right))
    scale = np.abs(solutions[1]).max()
    # Single precision, and a matrix whose condition number is about 1e4.
    np.testing.assert_allclose(solutions[0] / scale, solutions[1] / scale, atol=1e-3)


def test_every_slot_belongs_to_one_entry():
    model = _simulation("arc", [7, 10]).model
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    storage = Dissection(model, rows[used], columns[used])
    pairs = np.stack([np.maximum(rows, columns)[used], np.minimum(rows, columns)[used]])
    places = {}
    for pair, slot in zip(pairs.T.tolist(), storage.slots.tolist(), strict=True):
        assert places.setdefault(tuple(pair), slot) == slot
    assert len(set(places.values())) == len(places)
    assert sorted(storage.order) == list(range(model.n_free_nodes))


def test_a_matrix_that_is_not_definite_is_told():
    model = _simulation("arc", [7, 7]).model
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    storage = Dissection(model, rows[used], columns[used])
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        storage.factor(np.full(storage.size, -1.0, dtype=storage.dtype))

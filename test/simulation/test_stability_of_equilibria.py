"""`settle` says whether its equilibrium is stable, and finds the stable ones beside an unstable one."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from ldcs_ros import Simulation, load_scene
from ldcs_ros.simulation import linear_model


def _compressed_strip() -> Simulation:
    """Return a strip that gravity along its own axis pushes together beyond its buckling load."""
    return load_scene(
        {
            "lattice": {"size": [0.3, 0.05, 0.02], "nodes": [7, 2], "mass": 0.05},
            "points": {"P1": ["mid", "free_edge"]},
            "effects": [
                {"type": "springs", "law": "axial", "stiffness": 300.0, "damping": 1.0},
                {"type": "gravity", "acceleration": [-12.9, 0.0, 0.0]},
                {"type": "clamp", "edge": "x_min"},
            ],
        }
    ).build()


def test_an_unstable_equilibrium_is_told_with_its_direction() -> None:
    simulation = _compressed_strip()
    with pytest.warns(UserWarning, match=r"unstable: lowest eigenvalue -.*leaves along"):
        found = simulation.settle()
    assert not found.is_stable
    assert found.eigenvalue < 0.0
    assert np.max(np.abs(found.direction)) == pytest.approx(1.0)
    # A strip that buckles leaves across itself, most at its free edge.
    assert abs(found.direction[np.argmax(np.linalg.norm(found.direction, axis=1))][2]) == pytest.approx(1.0)


def test_following_the_direction_leads_to_a_stable_equilibrium() -> None:
    simulation = _compressed_strip()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = simulation.settle(follow=True)
    assert found.is_stable
    bent = simulation.state.position
    assert np.max(np.abs(bent[:, 2])) > 0.05
    # Motion from there stays there.
    simulation.advance_to(simulation.time + 1.0)
    assert np.max(np.abs(simulation.state.position - bent)) < 1e-6


def test_both_sides_of_an_unstable_equilibrium_are_listed_and_nothing_changes() -> None:
    simulation = _compressed_strip()
    before = simulation.state.position.copy()
    found = simulation.equilibria()
    assert [one.stability.is_stable for one in found] == [False, True, True]
    up, down = (one.position[-1, 2] for one in found[1:])
    assert up * down < 0.0
    np.testing.assert_array_equal(simulation.state.position, before)
    assert simulation.time == 0.0


def test_a_hanging_sheet_is_stable() -> None:
    found = load_scene("hanging_sheet").build().settle()
    assert found.is_stable
    assert found.eigenvalue > 0.0


def test_a_sheet_with_a_hole_that_nothing_holds_is_unconstrained():
    # Nodes of a hole are left out of the free ones, but hold nothing.
    sheet = {"size": [0.14, 0.14, 0.01], "nodes": [7, 7], "mass": 0.16}
    holed = sheet | {"holes": [{"circle": [0.07, 0.0, 0.03]}]}
    springs, clamp = {"type": "springs"}, {"type": "clamp"}
    for lattice in (sheet, holed):
        assert load_scene({"lattice": lattice, "effects": [springs]}).build().model.is_unconstrained
        assert not load_scene({"lattice": lattice, "effects": [springs, clamp]}).build().model.is_unconstrained


def test_a_search_finds_the_same_lowest_modes_as_dense_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = _compressed_strip()
    with pytest.warns(UserWarning, match="unstable"):
        simulation.settle()
    at = simulation.operating_point()
    by_q, _ = linear_model.stiffness_and_damping(at.model, at.time, at.q, at.u, at.held)
    dense, shapes = linear_model.natural_modes(at.model, at.q, by_q, 3)
    monkeypatch.setattr(linear_model, "MOST_DENSE", 0)
    searched, found = linear_model.natural_modes(at.model, at.q, by_q, 3)
    # The first one is negative: the strip buckles.
    assert dense[0] < 0.0
    np.testing.assert_allclose(searched, dense, rtol=1e-6)
    mass = linear_model.mass_matrix(at.model, at.q)
    np.testing.assert_allclose(np.abs(found.T @ mass @ shapes), np.eye(3), atol=1e-6)

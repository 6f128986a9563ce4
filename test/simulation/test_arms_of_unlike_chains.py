"""Derivatives at rest where one arm has fewer links than another: its missing links take no part."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from ldcs_ros import load_scene
from ldcs_ros.errors import SolverError
from ldcs_ros.simulation.linear_model import rest_factors

SCENE = {
    "lattice": {"size": [0.12, 0.08, 0.008], "nodes": [5, 4], "mass": 0.1},
    "points": {"tip": {"x": 0.12, "y": 0.0}},
    "effects": [
        {"type": "springs"},
        {"type": "gravity"},
        {"type": "clamp"},
        {
            "type": "arms",
            "drive": "pressure",
            "arms": [
                {"name": "long", "from": [0.0, 0.03], "to": [0.11, 0.03]},
                {"name": "short", "from": [0.0, -0.03], "to": [0.08, -0.02], "links": 2},
            ],
        },
    ],
}
PRESSURE = np.array([20e3, 30e3])


def settled(pressure):
    simulation = load_scene(SCENE).build()
    simulation.inputs.set_pressure(pressure)
    stability = simulation.settle()
    return simulation, stability


def test_a_point_moves_with_the_pressure_of_either_arm_as_differences_say():
    simulation, stability = settled(PRESSURE)
    assert stability.is_stable
    found = simulation.sensitivity(of=["tip"], to=["pressure.long", "pressure.short"]).values
    for k, step in enumerate(100.0 * np.eye(2)):
        ahead, behind = (settled(PRESSURE + sign * step)[0].pose("tip")[0] for sign in (1.0, -1.0))
        # The third derivative over 100 Pa, and the rest states' own accuracy, are far below a thousandth.
        assert found[:, k] == pytest.approx(
            (ahead - behind) / 200.0, rel=1e-3, abs=1e-3 * np.abs(found).max()
        )


def test_missing_links_are_no_modes():
    simulation, _ = settled(PRESSURE)
    # A mode of its own would have the frequency 0.
    assert simulation.linearize().frequencies[0] > 1.0


def test_a_rest_state_that_nothing_determines_is_an_error_in_words():
    loose = sparse.csc_matrix(np.array([[-1.0, 1.0], [1.0, -1.0]]))
    for by_q in (loose, loose + sparse.diags([0.0, -1e-17])):
        with pytest.raises(SolverError, match="not determined"):
            rest_factors(by_q.tocsc())

"""Nodes on a line have no orientation: one clear error, never numbers that are not finite."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError


@pytest.mark.parametrize("axes", [[1, 2], [0, 1, 2]], ids=["on a line", "in one place"])
def test_a_sheet_without_orientation_is_refused_in_one_line(axes):
    simulation = load_scene("arc").build()
    position = simulation.state.position.copy()
    position[:, axes] = 0.0
    simulation.start_from(position)
    point = simulation.points["P1"]
    with pytest.raises(DivergenceError, match="no orientation"):
        simulation.pose("P1")
    with pytest.raises(DivergenceError, match="no torque"):
        point.moment_as_nodal_forces(position, np.array([0.0, 0.0, 1e-3]))


def test_a_strongly_sheared_sheet_keeps_its_orientation():
    simulation = load_scene("arc").build()
    position = simulation.state.position.copy()
    position[:, 1] = position[:, 0] + 1e-6 * position[:, 1]
    frame = simulation.points["P1"].frame(position)
    assert np.isfinite(frame).all()
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-6)

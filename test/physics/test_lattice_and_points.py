"""The lattice is the paper's; points and their frames follow the sheet."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import point_at, quaternion

PAPER = Lattice((0.14, 0.14, 0.01), (9, 9), 0.16)


def _rotation(axis, angle):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_the_papers_lattice_has_1169_springs_and_17_11_7_neighbours():
    neighbours = np.bincount(PAPER.springs.ravel())
    assert len(PAPER.springs) == 1169
    assert len(np.unique(PAPER.springs, axis=0)) == 1169
    assert neighbours[PAPER.node("bottom", 4, 4)] == 17
    assert neighbours[PAPER.node("top", 0, 4)] == 11
    assert neighbours[PAPER.node("top", 8, 8)] == 7
    assert PAPER.node_mass[0] == pytest.approx(9.877e-4, rel=1e-4)


@pytest.mark.parametrize("nodes", [(2, 2), (2, 33), (33, 2), (5, 4)])
def test_springs_join_all_nodes_at_most_one_cell_apart(nodes):
    lattice = Lattice((0.14, 0.2, 0.01), nodes, 0.16)
    place = np.stack(np.unravel_index(np.arange(lattice.n_nodes), (2, *nodes)), axis=1)
    apart = np.abs(place[:, None] - place[None, :])
    near = (apart[..., 1:] <= 1).all(axis=2)
    expected = np.argwhere(np.triu(near, k=1))
    np.testing.assert_array_equal(lattice.springs, expected)


def test_rest_positions_are_centred_on_the_clamped_edge():
    assert PAPER.reference_position[PAPER.node("bottom", 0, 0)] == pytest.approx([0.0, -0.07, -0.005])
    assert PAPER.reference_position[PAPER.node("top", 8, 8)] == pytest.approx([0.14, 0.07, 0.005])
    assert PAPER.node_area.sum() == pytest.approx(2 * 0.14 * 0.14)


@pytest.mark.parametrize("nodes", [(9, 9), (8, 9), (2, 2), (33, 4)])
def test_centre_and_free_edge_are_places_at_any_resolution(nodes):
    lattice = Lattice((0.14, 0.14, 0.01), nodes, 0.16)
    assert point_at(lattice, "centre").position(lattice.reference_position) == pytest.approx([0.07, 0.0, 0.0])
    assert point_at(lattice, ["top", "free_edge"]).position(lattice.reference_position) == pytest.approx(
        [0.14, 0.0, 0.005]
    )


@pytest.mark.parametrize(
    "place", ["P9", ["mid", 9, 0], ["middle", 1, 1], ["mid", 1.0, 2], ["mid", "edge"], 3, ["top", -1, 0]]
)
def test_a_place_that_is_not_there_is_refused(place):
    with pytest.raises(ValueError):
        point_at(PAPER, place)


@pytest.mark.parametrize("name", ["centre", "free_edge", "node_top_0_0", "node_bottom_8_3"])
def test_a_frame_turns_with_the_sheet(name):
    turn = _rotation((0.3, -0.8, 0.5), 2.2)
    position, orientation = point_at(PAPER, name).pose(PAPER.reference_position @ turn.T + 0.3)
    np.testing.assert_allclose(orientation, quaternion(turn), atol=1e-12)
    np.testing.assert_allclose(
        position, turn @ point_at(PAPER, name).position(PAPER.reference_position) + 0.3, atol=1e-12
    )


def test_quaternions_of_half_turns_are_unit_and_exact():
    for axis in np.eye(3):
        np.testing.assert_allclose(np.abs(quaternion(_rotation(axis, np.pi))[:3]), np.abs(axis), atol=1e-12)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.0, -0.07), (0.14, 0.07), (0.07, 0.069)])
def test_a_sheet_covers_its_outline_and_nothing_beyond(x, y):
    assert PAPER.covers(x, y)
    assert not PAPER.covers(x - 0.1401, y) and not PAPER.covers(x + 0.1401, y)
    assert not PAPER.covers(x, y + 0.1401) and not PAPER.covers(x, y - 0.1401)
    assert not PAPER.covers(x, 0.0701) and not PAPER.covers(x, -0.0701)

"""Surfaces other than the paper's: places in metres, arms in any direction, holes, regions and part clamps."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ldcs_ros.errors import SceneError
from ldcs_ros.physics.column_frames import fill_column_frames
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import point_at
from ldcs_ros.physics.shapes import Disc, Polygon, Rectangle, SheetRegion
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.fields import SheetPlace

SPRINGS = {"type": "springs", "stiffness": 80.0, "damping": 5.0}


def sheet(*effects, nodes=(9, 9), size=(0.14, 0.14, 0.01), **more):
    return {
        "lattice": {"size": list(size), "nodes": list(nodes), "mass": 0.16, **more},
        "effects": [SPRINGS, *effects],
    }


def rotated_content(angle):
    """Two arms of one length from the centre line, in directions that differ by an angle."""
    dx, dy = 0.06 * math.cos(angle), 0.06 * math.sin(angle)
    arms = [{"name": "only", "from": [0.07 - dx, -dy], "to": [0.07 + dx, dy]}]
    return sheet({"type": "arms", "arms": arms, "joint_stiffness": 0.1})


def test_a_bilinear_point_is_where_its_place_says_on_any_mesh():
    for nodes in ((9, 9), (12, 7), (17, 5)):
        lattice = Lattice((0.14, 0.14, 0.01), nodes, 0.16)
        for layer, z in (("bottom", -0.005), ("mid", 0.0), ("top", 0.005)):
            point = point_at(lattice, SheetPlace(0.0513, -0.0237, layer))
            np.testing.assert_allclose(
                point.position(lattice.reference_position), [0.0513, -0.0237, z], atol=1e-15
            )
            np.testing.assert_allclose(point.frame(lattice.reference_position), np.eye(3), atol=1e-12)


def test_a_place_on_a_node_is_that_node():
    lattice = Lattice((0.14, 0.14, 0.01), (9, 9), 0.16)
    here, node = point_at(lattice, SheetPlace(0.14, 0.0, "top")), point_at(lattice, ["top", 8, 4])
    assert here.stencil == node.stencil and here.behind == node.behind and here.left == node.left
    assert set(here.patch) == set(node.patch)


def test_a_load_between_nodes_has_the_force_and_the_moment_of_its_place():
    lattice = Lattice((0.14, 0.14, 0.01), (8, 6), 0.16)
    point = point_at(lattice, SheetPlace(0.0513, -0.0237, "mid"))
    place = lattice.reference_position[point.nodes]
    assert point.fraction.sum() == pytest.approx(1.0, abs=1e-15)
    moment = np.cross(place, np.outer(point.fraction, [0.3, -0.2, 0.5])).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross([0.0513, -0.0237, 0.0], [0.3, -0.2, 0.5]), atol=1e-15)


def test_a_rotated_sheet_with_a_rotated_arm_is_the_same_sheet():
    # A square sheet turned by 90 degrees: the arm along x of one is the arm along y of the other.
    rest = {}
    for axis, ends in (("x", ([0.0, 0.0], [0.12, 0.0])), ("y", ([0.07, -0.07], [0.07, 0.05]))):
        arm = {"name": "only", "from": ends[0], "to": ends[1], "joint_stiffness": 0.1}
        clamp = {"type": "clamp", "edge": f"{axis}_min"}
        content = sheet(clamp, {"type": "gravity"}, {"type": "arms", "arms": [arm]})
        simulation = load_scene(content).build()
        simulation.inputs.set_torque(0.05)
        simulation.advance_to(0.2)
        rest[axis] = simulation.state.position.reshape(2, 9, 9, 3)
    along = rest["x"]
    turned = np.stack([along[..., 0] - 0.07, -along[..., 1], along[..., 2]], axis=-1).transpose(0, 2, 1, 3)
    # (x, y) of one is (y + 0.07, 0.07 - x) of the other.
    expected = np.stack([turned[..., 1] + 0.07, turned[..., 0], turned[..., 2]], axis=-1)[:, ::-1]
    np.testing.assert_allclose(rest["y"], expected, atol=2e-5)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.5, -2.0])
def test_an_arm_at_rest_bends_no_sheet_in_any_direction(angle):
    simulation = load_scene(rotated_content(angle)).build()
    q, u = simulation.model.reference_state()
    assert np.abs(simulation.model.force(0.0, q, u, simulation.inputs.held())).max() < 1e-9


@pytest.mark.parametrize("angle", [0.4, -1.1])
def test_opposite_directions_of_one_line_bend_alike(angle):
    # Torques lift the tip: the tips of both are lifted alike, and the sheet's shapes mirror each other.
    heights = []
    for turn in (angle, angle + math.pi):
        simulation = load_scene(rotated_content(turn)).build()
        simulation.inputs.set_torque(0.02)
        simulation.advance_to(0.1)
        heights.append(simulation.state.position[:, 2].reshape(2, 9, 9))
    np.testing.assert_allclose(heights[0], heights[1][:, ::-1, ::-1], atol=1e-6)


def test_the_default_arms_are_a_list_of_two():
    written = {
        "type": "arms",
        "width": 1,
        "arms": [
            {"name": "left", "from": [0.0, 0.07], "to": [0.14, 0.07]},
            {"name": "right", "from": [0.0, -0.07], "to": [0.14, -0.07]},
        ],
    }
    states = []
    for arms in ({"type": "arms", "width": 1}, written):
        simulation = load_scene(sheet({"type": "gravity"}, {"type": "clamp"}, arms)).build()
        simulation.inputs.set_torque([0.1, 0.05])
        simulation.advance_to(0.3)
        states.append(simulation.state.position)
    assert np.array_equal(*states)


def test_each_arm_has_its_own_numbers_and_links():
    arms = {
        "type": "arms",
        "drive": "pressure",
        "arms": [
            {"name": "a", "from": [0.0, 0.05], "to": [0.14, 0.05], "links": 3, "pressure_limit": 1e5},
            {"name": "b", "from": [0.0, -0.05], "to": [0.07, -0.05], "dead_time": 0.1, "pressure_gain": 2e-6},
        ],
    }
    simulation = load_scene(sheet({"type": "clamp"}, arms)).build()
    assert simulation.arm_names == ("a", "b")
    assert simulation.joint_names == (
        "a_joint_1",
        "a_joint_2",
        "a_joint_3",
        *(f"b_joint_{k}" for k in range(1, 5)),
    )
    with pytest.raises(Exception, match=r"expected 0 ... a 100000, b 200000 Pa"):
        simulation.inputs.set_pressure([1.1e5, 1.1e5])
    simulation.inputs.set_pressure([0.5e5, 1.5e5])
    simulation.advance_to(0.05)
    assert simulation.state.pressure[0] > 1e4 and simulation.state.pressure[1] == 0.0
    simulation.advance_to(2.0)
    torque = simulation.joint_torque.ravel()[simulation.joint_index]
    np.testing.assert_allclose(torque, [0.05] * 3 + [0.3] * 4, rtol=1e-5)
    # The link that the shorter chain does not have stays where it is.
    assert simulation.state.link_angle[0, 3] == 0.0 and simulation.state.link_rate[0, 3] == 0.0


def test_holes_leave_out_nodes_springs_and_mass():
    lattice = Lattice((0.2, 0.12, 0.006), (17, 13), 0.16, holes=(Disc((0.1, 0.0), 0.015),))
    place = lattice.reference_position
    inside = np.hypot(place[:, 0] - 0.1, place[:, 1]) < 0.015 - 1e-12
    assert set(lattice.missing) == set(np.flatnonzero(inside)) and inside.any()
    assert not inside[lattice.springs].any()
    assert lattice.node_mass.sum() == pytest.approx(0.16 * (1.0 - inside.mean()), rel=1e-12)


def test_a_cell_that_a_hole_cuts_counts_with_the_area_that_is_left():
    hole = Disc((0.1, 0.0), 0.025)
    lattice = Lattice((0.2, 0.12, 0.006), (17, 11), 0.16, True, holes=(hole,))
    left = lattice.cell_factor("whole")
    assert left.mean() == pytest.approx(1.0 - math.pi * 0.025**2 / (0.2 * 0.12), abs=1e-3)
    assert ((left > 0.0) & (left < 1.0)).any()
    # The mass of what is left, but for that of corners inside of the hole.
    assert 0.97 < lattice.node_mass.sum() / (0.16 * left.mean()) < 1.0
    aligned = Lattice((0.08, 0.08, 0.01), (9, 9), 0.16, holes=(Rectangle((0.02, -0.02, 0.04, 0.02)),))
    assert set(np.unique(aligned.cell_factor("whole"))) == {0.0, 1.0}


def test_nodes_on_the_outline_of_a_hole_stay():
    lattice = Lattice((0.08, 0.08, 0.01), (9, 9), 0.16, holes=(Rectangle((0.02, -0.02, 0.04, 0.02)),))
    gone = lattice.reference_position[lattice.missing]
    assert set(np.round(gone[:, 0], 9)) == {0.03} and set(np.round(gone[:, 1], 9)) == {-0.01, 0.0, 0.01}


def test_a_polygon_has_the_inside_of_its_outline():
    arrow = Polygon(((0.0, 0.0), (2.0, 1.0), (0.0, 2.0), (0.5, 1.0)))
    points = np.array([[1.0, 1.0], [0.25, 1.0], [0.4, 0.4], [1.9, 0.5], [-1.0, 1.0]])
    assert (arrow.distance(points) < 0.0).tolist() == [True, False, True, False, False]
    assert arrow.distance(np.array([[3.0, 1.0]]))[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("corners", "place"),
    [
        (((0, 0), (2, 2), (2, 0), (0, 2)), (1, 1)),  # a bow
        (((0, 0), (4, 0), (4, 2), (2, 0), (0, 2)), (2, 0)),  # a corner on a side
        (((0, 0), (2, 0), (1, 0), (1, 1)), (2, 0)),  # a side that goes back
        (((0, 0), (1, 1), (0, 2), (2, 2), (1, 1), (2, 0)), (1, 1)),  # a corner on a corner
        (((0, 0), (1, 0), (2, 0)), (2, 0)),  # no area
        (((0, 0), (2, 1), (0, 2), (0.5, 1)), None),
        (
            ((0, 0), (1, 0), (2, 0), (2, 1), (0, 1), (0, 0)),
            None,
        ),  # a corner on a straight side, closed by hand
    ],
)
def test_an_outline_that_meets_itself_is_told_with_the_place(corners, place):
    found = Polygon(tuple((float(x), float(y)) for x, y in corners)).crossing()
    assert found == (None if place is None else pytest.approx(place))


def test_a_simple_outline_of_many_corners_in_any_order_of_turning_does_not_meet_itself():
    draw = np.random.default_rng(11)
    angle = np.sort(draw.uniform(0.0, 2.0 * np.pi, 300))
    star = draw.uniform(0.2, 1.0, 300)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    for corners in (star, star[::-1]):
        assert Polygon(tuple(map(tuple, corners.tolist()))).crossing() is None
    swapped = star.copy()
    swapped[[10, 150]] = star[[150, 10]]
    assert Polygon(tuple(map(tuple, swapped.tolist()))).crossing() is not None


def test_regions_multiply_what_lies_in_them():
    half = SheetRegion(Rectangle((0.0, -0.06, 0.1, 0.06)), stiffness=3.0, mass=2.0, thickness=1.5)
    lattice = Lattice((0.2, 0.12, 0.006), (5, 4), 0.16, regions=(half,))
    x = lattice.reference_position[:, 0]
    factor = lattice.spring_factor("stiffness")
    ends = x[lattice.springs]
    assert np.all(
        factor[ends.max(axis=1) < 0.1 + 1e-9][ends[ends.max(axis=1) < 0.1 + 1e-9].min(axis=1) < 0.1 - 1e-9]
        == 3.0
    )
    assert np.all(
        factor[ends.min(axis=1) > 0.1 - 1e-9][ends[ends.min(axis=1) > 0.1 - 1e-9].max(axis=1) > 0.1 + 1e-9]
        == 1.0
    )
    # Springs and nodes on the border belong to both sides.
    assert np.all(factor[np.abs(ends - 0.1).max(axis=1) < 1e-9] == 2.0)
    np.testing.assert_allclose(
        lattice.node_mass * 40 / 0.16, np.where(x < 0.09, 2.0, np.where(x < 0.11, 1.5, 1.0))
    )
    thick = np.abs(lattice.reference_position[:, 2])
    np.testing.assert_allclose(thick, 0.003 * np.where(x < 0.09, 1.5, np.where(x < 0.11, 1.25, 1.0)))


@pytest.mark.parametrize("law", ["axial", "axiswise", "corotational"])
def test_a_free_sheet_with_a_hole_and_regions_keeps_its_momentum(law):
    content = sheet(
        nodes=(7, 7),
        holes=[{"circle": [0.07, 0.0, 0.03]}],
        regions=[{"box": [0.0, -0.07, 0.05, 0.07], "stiffness": 4.0, "damping": 0.5, "mass": 2.0}],
    )
    content["effects"] = [{**SPRINGS, "law": law}]
    simulation = load_scene(content).build()
    kept = np.setdiff1d(np.arange(98), simulation.lattice.missing)
    velocity = np.zeros((98, 3))
    velocity[kept] = np.random.default_rng(1).normal(0.0, 0.1, (len(kept), 3))
    mass = simulation.model.node_mass[:, None]
    before = (mass * velocity).sum(axis=0)
    simulation.start_from(simulation.lattice.reference_position, velocity)
    simulation.advance_to(0.05)
    after = (mass[kept] * simulation.state.velocity[kept]).sum(axis=0)
    np.testing.assert_allclose(after, before, atol=1e-6 * np.abs(before).max() + 1e-9)
    assert np.isnan(simulation.state.position[simulation.lattice.missing]).all()
    assert np.isfinite(simulation.state.position[kept]).all()


def test_columns_beside_a_hole_turn_with_the_sheet_and_not_with_the_nodes_that_it_lacks():
    lattice = Lattice((0.2, 0.12, 0.006), (17, 13), 0.16, holes=(Disc((0.1, 0.0), 0.03),))
    turn, kept = (
        Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix(),
        np.setdiff1d(np.arange(17 * 13), lattice.missing),
    )
    moved = lattice.reference_position @ turn.T + [0.1, -0.2, 0.3]
    moved[lattice.missing] = lattice.reference_position[lattice.missing]
    frames = np.empty((17 * 13, 3, 3))
    fill_column_frames(moved, lattice.column_neighbours, frames)
    np.testing.assert_allclose(frames[kept], np.broadcast_to(turn, (len(kept), 3, 3)), atol=1e-12)


def test_clamps_hold_a_part_of_an_edge_and_a_box():
    clamps = [
        {"type": "clamp", "edge": "x_min", "between": [-0.02, 0.02]},
        {"type": "clamp", "box": [0.10, 0.05, 0.14, 0.07]},
    ]
    model = load_scene(sheet(*clamps)).build().model
    held = np.setdiff1d(np.arange(486), model.free)[::3] // 3
    place = model.lattice.reference_position[held]
    expected = 2 * (3 + 6)  # rows -0.0175, 0, 0.0175; columns 0.105, 0.1225, 0.14 by rows 0.0525, 0.07
    assert len(held) == expected
    assert all((x == 0.0 and abs(y) < 0.02) or (x > 0.1 and y > 0.05) for x, y, _ in place)


ARM = {"name": "a", "from": [0.0, 0.0], "to": [0.14, 0.0]}


def with_arms(*arms, **more):
    return sheet({"type": "clamp"}, {"type": "arms", "arms": list(arms)}, **more)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (with_arms({**ARM, "to": [0.15, 0.0]}), r"x in 0 \.\.\. 0\.14.*@ effects\[2\]\.arms\[0\]\.to"),
        (with_arms(ARM, {**ARM, "to": [0.14, 0.05]}), r"'a' occurs twice.*@ effects\[2\]\.arms\[1\]\.name"),
        (with_arms(*({**ARM, "name": f"a{k}"} for k in range(17))), r"got 17 arms, expected 1 \.\.\. 16"),
        (with_arms(), r"got 0 arms"),
        (with_arms({**ARM, "to": [0.0, 0.0]}), "the same place"),
        (with_arms({**ARM, "stiffness": 2}), r"unknown key 'stiffness'.*@ effects\[2\]\.arms\[0\]"),
        (with_arms({**ARM, "drive": "torque"}), "unknown key 'drive'"),
        (
            with_arms(ARM, holes=[{"circle": [0.07, 0.0, 0.03]}]),
            r"'a' crosses a hole at x = 0.0.*@ effects\[2\]",
        ),
        (with_arms({**ARM, "from": [0.07, 0.0]}, holes=[{"circle": [0.09, 0.0, 0.02]}]), "crosses a hole"),
        (sheet(holes=[{"box": [0.03, -0.08, 0.06, 0.08]}]), "2 pieces"),
        (sheet(holes=[{"box": [0.03, -0.08, 0.03, 0.08]}]), r"opposite corners.*@ lattice\.holes\[0\]\.box"),
        (sheet(regions=[{"box": [0.0, 0.0, 0.1, 0.1]}]), "a factor out of"),
        (
            sheet({"type": "payload", "at": {"x": 0.2, "y": 0.0}, "mass": 0.01}),
            r"on the sheet.*effects\[1\]\.at",
        ),
        (sheet({"type": "payload", "at": {"x": 0.1}, "mass": 0.01}), r"expected \{x: m, y: m"),
        (sheet({"type": "clamp", "edge": "x_min", "between": [0.2, 0.3]}), "with nodes in it"),
    ],
)
def test_a_bad_surface_is_one_clear_line(content, words):
    with pytest.raises(SceneError, match=words) as caught:
        load_scene(copy.deepcopy(content)).build()
    assert "\n" not in str(caught.value)

"""The markers show what is there: mesh in colours of height, arms, loads with their sizes, traces."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.loads import rotate
from ldcs_ros.messages.display.marker import ARROW, CYLINDER, LINE_STRIP, SPHERE, TEXT
from ldcs_ros.messages.display.markers import LENGTH, MARKER_TOPICS, STEP, DrawableState, Markers, Traces
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.twin.twin import Twin

PAPER = load_scene("paper")
REST = PAPER.lattice.reference_position
STRAIGHT = np.zeros((2, 4))


def shown(markers, topic, **state):
    """Return the markers of a topic, without the one that clears, by namespace."""
    what = DrawableState(**{"position": REST, "link_angle": STRAIGHT, **state})
    message = decode(TOPICS[topic].type, markers.build(topic, 5, what))
    assert message.markers[0].action == 3
    assert all(one.header.frame_id == "ldcs_base" for one in message.markers)
    return {one.ns: one for one in message.markers[1:]}


def ends(marker):
    return np.array([[one.x, one.y, one.z] for one in marker.points])


def test_markers_are_built_only_while_they_have_subscribers():
    listened, collected = set(), []
    twin = Twin(
        load_scene("hanging_sheet"),
        sinks=[lambda *m: collected.append(m)],
        has_subscribers=listened.__contains__,
    )
    twin.advance_to(0.02)
    assert not {message[0] for message in collected} & set(MARKER_TOPICS)
    listened |= set(MARKER_TOPICS)
    twin.advance_to(0.04)
    for topic in MARKER_TOPICS:
        assert [message[3] for message in collected if message[0] == topic] == [40_000_000]


def test_the_surface_is_coloured_by_its_height():
    raised = REST.copy()
    raised[:, 2] += np.linspace(-0.07, 0.07, len(REST))
    message = decode(TOPICS["surface"].type, Markers(PAPER).build("surface", 0, DrawableState(raised)))
    heights = np.array([one.z for one in message.points])
    painted = np.array([[one.r, one.g, one.b, one.a] for one in message.colors])
    assert np.array_equal(painted, colours.of_height(heights, 0.14).astype(np.float64))
    low, high = painted[np.argmin(heights)], painted[np.argmax(heights)]
    assert low[2] > low[1] and high[0] > 0.9  # dark blue, yellow


def test_the_scale_of_colours_goes_half_a_length_down_and_up():
    below, level, above = colours.of_height(np.array([-1.0, 0.0, 1.0]), 0.14)
    edges = colours.of_height(np.array([-0.07, 0.07]), 0.14)
    assert np.array_equal([below, above], edges)
    assert np.array_equal(level, colours.of_height(np.array([0.0]), 2.0)[0])


def test_a_payload_is_a_ball_of_its_weight_with_its_arrow_and_label():
    drawn = Markers(PAPER).build("loads", 0, DrawableState(REST))
    kinds = {one.type: one for one in decode(TOPICS["loads"].type, drawn).markers[1:]}
    assert set(kinds) == {SPHERE, ARROW, TEXT}
    ball = kinds[SPHERE]
    assert np.pi / 6.0 * ball.scale.x**3 * 7850.0 == pytest.approx(0.040)
    assert ball.pose.position.x == pytest.approx(0.14)
    start, end = ends(kinds[ARROW])
    assert end - start == pytest.approx([0.0, 0.0, -0.040 * 9.81 * 0.1])
    assert kinds[TEXT].text == "40 g"


def test_the_force_of_a_scene_is_an_arrow_with_its_size():
    markers = Markers(load_scene("arc"))
    lattice = load_scene("arc").lattice
    loads = shown(markers, "loads", position=lattice.reference_position, link_angle=np.zeros((0, 0)))
    assert ends(loads["force"])[1, 2] < ends(loads["force"])[0, 2]
    assert loads["force/label"].text.endswith(" N")


def test_a_wrench_turns_with_its_frame_unless_it_is_aligned():
    upright = np.stack([-REST[:, 2], REST[:, 1], REST[:, 0]], axis=1)  # a quarter turn: x has become z
    pull = SimpleNamespace(force=(0.5, 0.0, 0.0), torque=(0.0, 0.02, 0.0))
    loads = shown(
        Markers(PAPER), "loads", position=upright, wrenches={"P0": pull, "node_top_8_4_aligned": pull}
    )
    moved = {name: np.diff(ends(loads[name]), axis=0)[0] for name in loads if loads[name].type == ARROW}
    assert moved["P0"] == pytest.approx([0.0, 0.0, 0.05], abs=1e-12)
    assert moved["node_top_8_4_aligned"] == pytest.approx([0.05, 0.0, 0.0], abs=1e-12)
    assert moved["P0/torque"] == pytest.approx([0.0, 0.02, 0.0], abs=1e-12)
    assert loads["P0/label"].text == "0.5 N, 0.02 N m"


def test_the_arms_are_where_the_sheet_is():
    simulation = PAPER.build()
    simulation.advance_to(0.5)
    state = simulation.state
    arms = shown(Markers(PAPER), "arms", position=state.position, link_angle=state.link_angle)
    links = [f"{arm}/link_{k}" for arm in ("left", "right") for k in (1, 2, 3, 4)]
    assert {name for name in arms if arms[name].type == CYLINDER} == set(links)
    joints = ends(arms["left/joints"])
    edge = state.position[PAPER.lattice.index[:, ::2, -1]].mean(axis=0)
    assert joints[:, [0, 2]] == pytest.approx(edge[:-1, [0, 2]], abs=1.5e-3)
    assert joints[:, 1] == pytest.approx(0.06125)  # the middle of the one cell that it covers


def test_a_link_reaches_from_joint_to_joint():
    angles = np.array([[0.1, 0.4, 0.9, 1.2], [0.0, 0.0, 0.0, 0.0]])
    arms = shown(Markers(PAPER), "arms", link_angle=angles)
    joints = ends(arms["left/joints"])
    for k in range(3):
        link = arms[f"left/link_{k + 1}"]
        turn, middle = link.pose.orientation, link.pose.position
        along = rotate(np.array([turn.x, turn.y, turn.z, turn.w]), (0.0, 0.0, 0.5 * link.scale.z))
        assert np.array([middle.x, middle.y, middle.z]) - along == pytest.approx(joints[k])
        assert np.array([middle.x, middle.y, middle.z]) + along == pytest.approx(joints[k + 1])
    assert arms["right/link_1"].scale.z == pytest.approx(0.035)


def test_driven_edges_are_drawn_as_they_stand():
    scene = load_scene("arc")
    rest = scene.lattice.reference_position
    arms = shown(Markers(scene), "arms", position=rest, link_angle=np.zeros((0, 0)))
    assert set(arms) == {"y_min", "y_max"}
    assert ends(arms["y_max"])[:, 1] == pytest.approx(0.07)


def test_a_trace_grows_while_its_point_moves_and_stays_while_it_rests():
    traces = Traces()
    for k in range(10):
        traces.follow(k, {"P1": np.array([0.0, 0.0, STEP * min(k, 4)])})
    (line,) = traces.specs()
    assert (line.namespace, line.kind) == ("P1", LINE_STRIP)
    assert np.array(line.points)[:, 2] == pytest.approx(STEP * np.arange(5))


def test_a_trace_is_bounded_and_begins_anew_when_time_goes_back():
    traces = Traces()
    for k in range(2 * LENGTH):
        traces.follow(k, {"P1": np.array([STEP * k, 0.0, 0.0])})
    (line,) = traces.specs()
    assert len(line.points) == LENGTH
    traces.follow(0, {"P1": np.zeros(3)})
    assert traces.specs() == []

"""A bag and a running twin are shown alike: mesh, arms, loads, points with traces, curves."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.surface import triangles
from ldcs_ros.messages.topics import TOPICS, expand
from ldcs_ros.twin.twin import Twin
from ldcs_ros.viewing.live_viewer import LiveViewer, is_shown
from ldcs_ros.viewing.rerun_scene import CurveColours, ShadedMesh

NEEDS_RERUN = "the viewer is not installed: make viewer"


def entities(path):
    """Return the paths of what a .rrd file holds, read by the viewer's own program."""
    from ldcs_ros.viewing.rerun_package import program

    subprocess.run([str(program()), "rrd", "verify", str(path)], check=True, capture_output=True)
    printed = subprocess.run(
        [str(program()), "rrd", "print", str(path)], check=True, capture_output=True, text=True
    ).stdout
    return {word.strip("`,") for word in printed.split() if word.startswith("/")}


def test_the_shaded_mesh_is_the_mesh_with_faces_of_their_own():
    mesh, rest = ShadedMesh((4, 3)), load_scene("paper").lattice.reference_position
    grid = np.stack(np.meshgrid([0.0, 1.0], range(4), range(3), indexing="ij"), axis=-1)
    position = grid.reshape(-1, 3)[:, [1, 2, 0]]
    place, normal = mesh.corners(position)
    assert np.array_equal(place[mesh.triangles], position[triangles((4, 3))].astype(np.float32))
    assert len(place) == 2 * 12 + 2 * (2 * 4 + 2 * 3)
    assert np.sort(np.abs(normal), axis=1) == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(place), 1)))
    outward = np.einsum("ij,ij->i", normal, place - place.mean(axis=0))
    assert (outward > 0.0).all()
    painted = ShadedMesh((9, 9)).colours(rest, 0.14)
    assert painted.dtype == np.uint8 and (painted[:, 3] == 255).all()


def test_the_shaded_mesh_leaves_holes_open_with_sharp_walls():
    missing = np.array([12, 25 + 12])
    grid = np.stack(np.meshgrid([0.0, 1.0], range(5), range(5), indexing="ij"), axis=-1)
    position = grid.reshape(-1, 3)[:, [1, 2, 0]]
    position[missing] = np.nan
    mesh = ShadedMesh((5, 5), missing)
    place, normal = mesh.corners(position)
    # 12 of 16 cells in two layers, a wall of 16 cells around and of 8 around the hole; two triangles each.
    assert len(mesh.triangles) == 2 * (2 * 12 + 16 + 8)
    assert np.isfinite(place).all() and np.isfinite(normal).all()
    assert np.sort(np.abs(normal), axis=1) == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(place), 1)))
    assert np.isin([1.0, 3.0], place[normal[:, 0] == 1.0, 0]).tolist() == [True, False]


def test_each_arm_and_joint_has_a_colour_of_its_own():
    colours = CurveColours()
    arms = [colours.of(name) for name in ("left", "middle", "right")]
    joints = [colours.of(f"{arm}_joint_{k}") for arm in ("left", "middle", "right") for k in (1, 2)]
    assert len({*arms}) == 3 and len({*joints}) == 6
    assert colours.of("left") == arms[0] and colours.of("z") == CurveColours().of("z")
    assert sum(joints[0]) < sum(joints[2]) < sum(joints[4])


def test_what_is_shown_live_are_topics_of_the_twin():
    known = {**TOPICS, **expand("{point}/pose", ["P1"]), **expand("truth/{point}/pose", ["P1"])}
    known |= expand("{arm}/pressure", ["left"])
    shown = {name for name, topic in known.items() if is_shown(name, topic.type)}
    named = {"nodes", "P1/pose", "truth/P1/pose", "joint_states", "left/pressure", "arms", "loads"}
    assert shown - {name for name in shown if "{" in name} == named
    assert not is_shown("estimate/nodes", TOPICS["nodes"].type)
    assert not is_shown("nodes", "std_msgs/msg/String")


def test_a_bag_becomes_a_file_that_the_viewer_verifies(recording, tmp_path):
    pytest.importorskip("rerun", reason=NEEDS_RERUN)
    from ldcs_ros.viewing.from_bag import write_bag

    written = write_bag(recording, tmp_path / "lift.rrd", until=0.3)
    assert (written.start, written.end, written.surfaces, written.every) == (0.0, 0.3, 16, 1)
    assert written.points == ("P0", "P1")
    assert entities(tmp_path / "lift.rrd") >= {
        "/sheet/surface",
        "/arms/links",
        "/arms/balls",
        "/loads/arrows",
        "/loads/labels",
        "/points/P1",
        "/traces/P1",
        "/plots/P1_state/z",
        "/plots/P1_tracker/z",
        "/plots/gauge_pressure/left",
        "/plots/drive_torque/left_joint_1",
        "/plots/joint_angle/right_joint_4",
    }


def test_a_long_bag_is_thinned_evenly_and_says_so(recording, tmp_path):
    pytest.importorskip("rerun", reason=NEEDS_RERUN)
    from ldcs_ros.viewing.from_bag import write_bag

    written = write_bag(recording, tmp_path / "thin.rrd", most_surfaces=10)
    assert (written.surfaces, written.every) == (7, 3)


def test_nothing_to_show_is_said(recording, tmp_path):
    pytest.importorskip("rerun", reason=NEEDS_RERUN)
    from ldcs_ros.bags import Recording
    from ldcs_ros.viewing.from_bag import write_bag

    pressures = [m for m in recording.in_order() if m.topic.endswith("pressure")]
    with pytest.raises(RecordingError, match="nothing to show"):
        write_bag(Recording.from_messages(pressures), tmp_path / "none.rrd")


def test_a_running_twin_is_shown_and_a_reset_begins_anew(tmp_path):
    pytest.importorskip("rerun", reason=NEEDS_RERUN)
    from ldcs_ros.viewing.rerun_package import new_stream

    files = []

    def stream():
        files.append(tmp_path / f"{len(files)}.rrd")
        made = new_stream("a twin")
        made.save(files[-1])
        return made

    viewer = LiveViewer(stream)

    def sink(topic, message_type, cdr, time):
        if is_shown(topic, message_type):
            viewer.receive(topic, message_type, cdr)

    twin = Twin(load_scene("rig"), sinks=[sink], has_subscribers=lambda name: True)
    for end in (0.04, 0.08, 0.1):
        twin.advance_to(end)
        surfaces = viewer.draw()
    assert surfaces == 3
    twin.reset()
    twin.advance_to(0.02)
    assert viewer.draw() == 1
    viewer.close()
    first, second = files
    for path in (first, second):
        assert entities(path) >= {
            "/sheet/surface",
            "/arms/links",
            "/loads/arrows",
            "/traces/P1",
            "/plots/P1_state/z",
            "/plots/gauge_pressure/left",
            "/plots/joint_angle/left_joint_1",
        }

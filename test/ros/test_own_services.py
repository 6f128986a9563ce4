"""Our own messages and services, live: whole state, solver, wrenches for a while, another scene without a restart."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from live import stamp
from std_msgs.msg import Float64MultiArray

from ldcs_ros.bags import read_bag
from ldcs_ros.replay.session import replay

srv = pytest.importorskip("ldcs_msgs.srv", reason="the interface package is not built")

from builtin_interfaces.msg import Duration  # noqa: E402
from geometry_msgs.msg import Vector3, Wrench  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402

NODES = "/ldcs/nodes"
SMALL = """\
title: A small sheet without arms
lattice: {size: [0.14, 0.14, 0.01], nodes: [3, 4], mass: 0.16}
points: {P1: [mid, free_edge]}
effects:
  - {type: springs, stiffness: 80.0, damping: 5.0}
  - {type: clamp, edge: x_min}
  - {type: wrench}
solver: {integrator: auto, accuracy: 1.0e-4}
"""


def push(user, force=0.5, **fields):
    """Ask for a wrench along z at P1 for 0.2 s with ramps of 0.05 s."""
    fields = {"point": "P1", "frame_id": "ldcs_base", "duration": 0.2, "ramp": 0.05} | fields
    for name in ("duration", "ramp"):
        seconds = fields[name]
        fields[name] = Duration(sec=int(seconds // 1), nanosec=round(seconds % 1 * 1e9))
    request = srv.ApplyWrench.Request(**fields, wrench=Wrench(force=Vector3(z=force)))
    return user.call("/ldcs/ldcs_sim/apply_wrench", srv.ApplyWrench, request)


def load(user, scene):
    """Ask for another scene."""
    return user.call("/ldcs/ldcs_sim/load_scene", srv.LoadScene, srv.LoadScene.Request(scene=scene))


def test_wrenches_and_scenes_come_and_go_and_each_bag_replays_to_the_byte(start, tmp_path):
    scene = tmp_path / "sheet.yaml"
    scene.write_text(SMALL.replace("A small", "Another small"))
    node, user = start(
        scene="rig", record=tmp_path / "bag", record_detail=True, duration=1e6, graph_folder=tmp_path
    )
    user.listen(NODES, "sensor_msgs/PointCloud2")
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    user.listen("/ldcs/lattice_state", "ldcs_msgs/LatticeState")
    user.listen("/ldcs/solver_status", "ldcs_msgs/SolverStatus")
    user.publisher("/ldcs/pressure_command", Float64MultiArray).publish(Float64MultiArray(data=[5e4]))

    # Refusals are counted; state and solver are reported.
    refused = push(user, point="P7")
    assert not refused.success and refused.message.startswith("unknown frame")
    state, status = user.next("/ldcs/lattice_state"), user.next("/ldcs/solver_status")
    assert (state.nodes_x, state.nodes_y, list(state.arms), state.links) == (9, 9, ["left", "right"], 4)
    assert status.integrator == "esdirk43" and status.steps > 0 and status.rejected_commands == 1
    cloud = user.until(lambda: next((c for c in user.received[NODES] if stamp(c) == stamp(state)), None))
    single = np.frombuffer(bytes(cloud.data), np.float32).reshape(-1, 6)[:, :3]
    assert np.array_equal(single, np.reshape(state.position, (-1, 3)).astype(np.float32))

    # A scene that cannot be loaded changes nothing.
    time = stamp(user.next(NODES))
    for bad in ("no_such_scene", "", "title: [", SMALL.replace("mass: 0.16", "mass: -1.0")):
        answer = load(user, bad)
        assert not answer.success and answer.message and not answer.effects
    assert stamp(user.next(NODES)) > time and user.next(NODES).height == 18

    # Another scene starts from its beginning, with its own topics and its own bag.
    answer = load(user, SMALL)
    assert (answer.success, answer.message) == (True, "A small sheet without arms")
    assert list(answer.effects) == ["springs", "clamp", "wrench"]
    small = user.until(lambda: next((c for c in user.received[NODES] if c.height == 6), None))
    assert stamp(small) == 0
    user.until(lambda: user.node.count_publishers("/ldcs/joint_states") == 0)
    done = push(user)
    assert done.success and "P1_aligned: 0.5 N" in done.message
    assert push(user, frame_id="P1", duration=0.0, ramp=0.0).success
    for fields in ({"point": "P9"}, {"force": 1e9}, {"ramp": 0.3}, {"force": float("nan")}):
        assert not push(user, **fields).success
    assert user.diagnostics("commands")["refused"] == "5"
    user.spin(0.4)

    assert load(user, "sheet.yaml").message == "Another small sheet without arms"
    user.spin(0.2)
    assert load(user, "single_spring").success
    user.spin(0.2)
    assert node.stop(signal.SIGINT) == 0
    assert "Traceback" not in node.output
    names = ["bag", "bag_scene1", "bag_scene2", "bag_scene3"]
    assert sorted(path.name for path in tmp_path.glob("bag*")) == names
    assert len(read_bag(tmp_path / "bag_scene1").channels["/ldcs/external_wrench"]) == 13
    for name in names:
        verdict = replay(tmp_path / name, tmp_path / f"again_{name}").verdict
        assert verdict.same_bytes and verdict.messages > 10, (name, verdict)


def test_a_request_reaches_no_file_outside_the_folder_and_reads_none_by_its_refusal(start, tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "broken.yaml").write_text("password: hunter2\n")
    (tmp_path / "outside.yaml").write_text(SMALL)
    (folder / "link.yaml").symlink_to(tmp_path / "outside.yaml")
    node, user = start(scene="single_spring", graph_folder=folder)
    refusals = {
        load(user, path).message.replace(path, "")
        for path in (
            str(tmp_path / "outside.yaml"),
            str(tmp_path / "absent.yaml"),
            "../outside.yaml",
            "link.yaml",
        )
    }
    assert len(refusals) == 1 and "graph_folder" in refusals.pop()
    answer = load(user, "broken.yaml")
    assert not answer.success and "hunter2" not in answer.message and "password" not in answer.message
    assert "password" in node.output
    user.change_state(Transition.TRANSITION_DEACTIVATE)
    user.change_state(Transition.TRANSITION_CLEANUP)
    for name, value in (("scene", str(tmp_path / "outside.yaml")), ("record", str(tmp_path / "bag"))):
        answer = user.set_parameters(**{name: value}).results[0]
        assert not answer.successful and "graph_folder" in answer.reason
    assert user.set_parameters(record=str(folder / "bag")).results[0].successful


def test_without_a_folder_no_request_names_a_file(start, tmp_path):
    (tmp_path / "mine.yaml").write_text(SMALL)
    _, user = start(scene="single_spring")
    answer = load(user, str(tmp_path / "mine.yaml"))
    assert not answer.success and "graph_folder" in answer.message
    assert load(user, "hanging_sheet").success and load(user, SMALL).success


def test_a_scene_is_loaded_paused_when_the_twin_is_paused(start):
    _, user = start(scene="single_spring")
    user.listen(NODES, "sensor_msgs/PointCloud2")
    user.next(NODES)
    assert user.call("/ldcs/ldcs_sim/pause").success
    assert load(user, SMALL).success
    first = user.until(lambda: next((c for c in user.received[NODES] if c.height == 6), None))
    user.received[NODES].clear()
    user.spin(0.3)
    assert stamp(first) == 0 and not user.received[NODES]
    assert user.call("/ldcs/ldcs_sim/step").message == "t = 0.02 s"


def test_the_service_files_are_those_that_are_built():
    folder = Path(__file__).parents[2] / "msg_defs" / "srv"
    assert sorted(path.stem for path in folder.glob("*.srv")) == ["Advance", "ApplyWrench", "LoadScene", "Reach"]
    for name in ("Advance", "ApplyWrench", "LoadScene", "Reach"):
        fields = getattr(srv, name).Request.get_fields_and_field_types()
        text = (folder / f"{name}.srv").read_text().split("---")[0]
        assert [line.split()[1] for line in text.splitlines() if line and line[0] != "#"] == list(fields)

"""The URDF of the arms and the frames of their links describe one chain, the one that is drawn."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ldcs_ros import load_scene
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.display.arm_lines import ArmLines
from ldcs_ros.messages.display.robot_model import RobotModel
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

LISTED = [
    {"name": "left", "from": [0.0, 0.07], "to": [0.14, 0.07], "links": 3},
    {"name": "across", "from": [0.14, -0.07], "to": [0.0, 0.0], "links": 2},
]


def scene_with(**arms):
    return load_scene(
        {
            "title": "A sheet with arms",
            "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [5, 5], "mass": 0.16},
            "points": {"P1": ["mid", "free_edge"]},
            "effects": [
                {"type": "springs", "stiffness": 80.0, "damping": 5.0},
                {"type": "clamp", "edge": "x_min"},
                {"type": "arms", "drive": "pressure", **arms},
            ],
            "solver": {"integrator": "auto", "accuracy": 1.0e-4},
        }
    )


def chain(urdf, joint_angle):
    """Return the pose of each link in ldcs_base as (position, rotation) by the joints of a URDF."""
    robot = ElementTree.fromstring(urdf)
    poses = {"ldcs_base": (np.zeros(3), Rotation.identity())}
    for joint in robot.findall("joint"):
        place, turn = poses[joint.find("parent").get("link")]
        origin = joint.find("origin")
        xyz, rpy = ([float(part) for part in origin.get(key).split()] for key in ("xyz", "rpy"))
        axis = np.array([float(part) for part in joint.find("axis").get("xyz").split()])
        own = Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(joint_angle[joint.get("name")] * axis)
        poses[joint.find("child").get("link")] = place + turn.apply(xyz), turn * own
    return poses


@pytest.mark.parametrize("arms", [{}, {"links": 2}, {"arms": LISTED}])
def test_joint_angles_in_the_urdf_give_the_frames_of_the_links_and_the_drawn_line(arms):
    scene = scene_with(**arms)
    simulation = scene.build()
    model = RobotModel(scene.lattice, scene.points, scene.effects)
    links = simulation.model.arms.links
    angle = np.random.default_rng(5).uniform(-0.6, 0.6, (len(links), max(links)))
    angle[np.arange(max(links)) >= links[:, None]] = 0.0
    joints = np.diff(angle, axis=1, prepend=0.0).ravel()[simulation.joint_index]
    by_joints = chain(model.description(), dict(zip(simulation.joint_names, joints, strict=True)))
    frames = model.link_poses(angle)
    assert [*frames] == [name for name in by_joints if name != "ldcs_base"]
    for name, (place, turn) in frames.items():
        np.testing.assert_allclose(place, by_joints[name][0], atol=1e-8)
        assert (Rotation.from_quat(turn).inv() * by_joints[name][1]).magnitude() < 1e-7
    lines = ArmLines(scene.lattice, scene.points, scene.effects).lines(
        simulation.state.position.reshape(-1, 3), angle
    )
    for name, line in lines.items():
        for link in range(2, len(line)):
            np.testing.assert_allclose(frames[f"{name}_link_{link}"][0], line[link - 1], atol=1e-12)


def test_the_twin_reports_the_links_on_tf_and_their_description_once():
    sent = []
    twin = Twin(scene_with(links=2), RunSettings(publish_tf=True, frame_prefix="twin1/"))
    twin.sinks.append(lambda *message: sent.append(message))
    twin.advance_to(0.02)
    children = {
        one.child_frame_id
        for name, kind, cdr, _ in sent
        if name == "/tf"
        for one in decode(kind, cdr).transforms
    }
    assert children == {"twin1/P1", *(f"twin1/{arm}_link_{k}" for arm in ("left", "right") for k in (1, 2))}
    (described,) = [decode(kind, cdr).data for name, kind, cdr, _ in sent if name == "robot_description"]
    assert "right_joint_2" in described


def test_without_arms_nothing_is_described():
    assert "robot_description" in Twin(scene_with(links=2)).topics
    assert "robot_description" not in Twin(load_scene("single_spring"), RunSettings(publish_tf=True)).topics

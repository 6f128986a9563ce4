"""docs/ros.md names only what there is: topics, services, parameters, launch files, executables."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from ldcs_ros import load_scene
from ldcs_ros.cli.effects import describe
from ldcs_ros.messages.topics import BASE_FRAME, TOPICS
from ldcs_ros.physics.effects import EFFECTS
from ldcs_ros.ros.common.service_table import SIM_SERVICES
from ldcs_ros.ros.sim.parameters import PARAMETERS
from ldcs_ros.ros.simulator.entities import Entities
from ldcs_ros.scene.schema import TOP_KEYS
from ldcs_ros.twin.twin import Twin

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/ros.md").read_text(encoding="utf-8")
SERVICES = {f"/ldcs/ldcs_sim/{one.name.removeprefix('~/')}": one.type for one in SIM_SERVICES}
# Words of ROS itself, and of the solver's keys.
OTHERS = {"use_sim_time", "dt", "ros2", "launch", "ldcs_ros", "effort", "frame_id"}
# Names of the node and of its launch files.
NODE = {"/ldcs", "ldcs_sim", "params_file"}


def commands(words):
    """Return the arguments of each line that runs a command."""
    return [line.split() for line in re.findall(rf"^    {words} (.*)$", PAGE, re.MULTILINE)]


def test_topics_and_services_of_the_first_round_are_there():
    topics = Twin(load_scene("rig")).topics
    for name, *_ in commands("ros2 topic echo"):
        assert name.removeprefix("/ldcs/") in topics
    for words in commands("ros2 topic pub --rate 10"):
        assert topics[words[0].removeprefix("/ldcs/")].type == words[1]
    for name, kind, *_ in [*commands("ros2 service call"), *commands("ros2 action send_goal --feedback")]:
        assert SERVICES[name] == kind
    for node, name, _ in commands("ros2 param set"):
        assert (
            node == "/ldcs/ldcs_sim" and not PARAMETERS[name].read_only and not PARAMETERS[name].at_configure
        )


def test_launch_files_and_their_arguments_are_there():
    lines = commands("ros2 launch ldcs_ros")
    assert lines
    for file, *given in lines:
        assert (ROOT / "ldcs_ros/launch" / file).is_file()
        assert {word.split(":=")[0] for word in given} <= {*PARAMETERS, "namespace", "params_file"}


def test_each_name_on_the_page_is_one_of_the_code():
    setup = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    known = {*TOPICS, *PARAMETERS, *TOP_KEYS, *EFFECTS, *OTHERS, *NODE}
    known |= {name.rpartition("/")[2] for name in SERVICES}
    known |= {parameter["name"] for name in EFFECTS for parameter in describe(name)["parameters"]}
    known |= {
        node.value.split(" = ")[0]
        for node in ast.walk(setup)
        if isinstance(node, ast.Constant) and " = " in str(node.value)
    }
    entities = Entities(load_scene("rig").build()).all
    known |= {*entities, BASE_FRAME, *(tag for entity in entities.values() for tag in entity.tags)}
    named = set(re.findall(r"`(/?[a-z][a-z0-9_]*)`", PAGE))
    assert named - known == set()

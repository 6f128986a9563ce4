"""The layouts for RViz and Foxglove name topics that exist, with their types, fields, frame and a fitting QoS."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from ldcs_ros.messages.cdr import message_class, typestore
from ldcs_ros.messages.display.colours import of_point
from ldcs_ros.messages.display.markers import MARKER_TOPICS
from ldcs_ros.messages.topics import BASE_FRAME, TOPICS, expand

CONFIG = Path(__file__).resolve().parents[2] / "ldcs_ros/config"
NAMESPACE = "/ldcs/"
POINTS, ARMS = ("P0", "P1"), ("left", "right")
KINDS = {
    "Marker": "visualization_msgs/msg/Marker",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Pose": "geometry_msgs/msg/PoseStamped",
}
# What Foxglove's 3D panel draws.
DRAWN = set(KINDS.values())


def published():
    """Return what a twin of the shipped scenes publishes, by absolute name."""
    topics = {name: topic for name, topic in TOPICS.items() if "{" not in name and topic.direction == "out"}
    topics |= expand("{point}/pose", POINTS) | expand("truth/{point}/pose", POINTS)
    topics |= expand("{arm}/pressure", ARMS)
    return {name if name.startswith("/") else NAMESPACE + name: topic for name, topic in topics.items()}


def rviz():
    """Return the RViz configuration."""
    return yaml.safe_load((CONFIG / "ldcs.rviz").read_text(encoding="utf-8"))


def displays():
    """Return the displays of the RViz configuration that listen to a topic."""
    return [one for one in rviz()["Visualization Manager"]["Displays"] if "Topic" in one]


def foxglove():
    """Return the Foxglove layout."""
    return json.loads((CONFIG / "foxglove_layout.json").read_text(encoding="utf-8"))


def paths():
    """Return the message paths that the plots of the Foxglove layout draw."""
    panels = foxglove()["configById"].values()
    return [line["value"] for panel in panels for line in panel.get("paths", [])]


@pytest.mark.parametrize("display", displays(), ids=lambda display: display["Name"])
def test_rviz_listens_to_topics_of_that_type_and_quality(display):
    package, kind = display["Class"].split("/")
    assert package == "rviz_default_plugins"
    topic = published()[display["Topic"]["Value"]]
    assert topic.type == KINDS[kind]
    wants = display["Topic"]
    assert wants["Reliability Policy"] in (
        ("Reliable", "Best Effort") if topic.reliable else ("Best Effort",)
    )
    assert wants["Durability Policy"] == "Volatile" or topic.transient_local
    assert wants["History Policy"] == "Keep Last" and wants["Depth"] <= topic.depth


def test_rviz_stands_in_the_base_frame_and_shows_all_markers():
    manager = rviz()["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == BASE_FRAME
    shown = {one["Topic"]["Value"] for one in displays() if one["Enabled"]}
    assert shown >= {
        NAMESPACE + topic for topic in (*MARKER_TOPICS, "nodes", "truth/P0/pose", "truth/P1/pose")
    }
    named = [one["Name"] for one in displays()]
    assert len(set(named)) == len(named)


def test_rviz_can_show_the_arms_as_a_robot():
    (model,) = (one for one in rviz()["Visualization Manager"]["Displays"] if "Description Topic" in one)
    topic, wants = published()[model["Description Topic"]["Value"]], model["Description Topic"]
    assert model["Class"] == "rviz_default_plugins/RobotModel" and model["Description Source"] == "Topic"
    assert topic.type == "std_msgs/msg/String" and topic.transient_local
    assert (wants["Durability Policy"], wants["Reliability Policy"]) == ("Transient Local", "Reliable")


def test_points_have_the_colours_of_their_traces():
    for number, name in enumerate(POINTS):
        colour = next(one["Color"] for one in displays() if one["Name"] == name)
        assert [int(part) for part in colour.split(";")] == pytest.approx(
            [255 * part for part in of_point(number)[:3]], abs=3
        )


def test_foxglove_draws_the_markers_in_the_base_frame():
    (panel,) = (panel for name, panel in foxglove()["configById"].items() if name.startswith("3D!"))
    assert panel["followTf"] == BASE_FRAME
    topics = published()
    for name in panel["topics"]:
        assert topics[name].type in DRAWN, name
    shown = {name for name, settings in panel["topics"].items() if settings["visible"]}
    assert shown >= {NAMESPACE + topic for topic in (*MARKER_TOPICS, "nodes")}
    assert all(layer["frameId"] == BASE_FRAME for layer in panel["layers"].values())


@pytest.mark.parametrize("path", paths())
def test_foxglove_plots_numbers_that_are_in_the_messages(path):
    match = re.fullmatch(r"(/[\w/]+)((?:\.\w+(?:\[\d+\])?)+)(\.@mul\([\d.]+\))?", path)
    assert match, path
    kind = published()[match[1]].type
    for field in match[2].strip(".").split("."):
        name = field.partition("[")[0]
        fields = dict(typestore(kind).fielddefs[kind][1])
        assert name in fields, f"{kind} has no field {name}"
        node, description = fields[name]
        is_sequence = int(node) in (3, 4)
        assert is_sequence == ("[" in field), path
        kind = description[0][1][0] if is_sequence else description
        if isinstance(kind, tuple):
            kind = kind[0]
    assert kind in ("float64", "float32"), path


def test_each_panel_of_foxglove_is_laid_out_once():
    layout = foxglove()

    def leaves(node):
        if isinstance(node, str):
            panel = layout["configById"][node]
            yield node
            for tab in panel.get("tabs", []):
                yield from leaves(tab["layout"])
        else:
            yield from leaves(node["first"])
            yield from leaves(node["second"])

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
    diagnostics = next(panel for panel in layout["configById"].values() if "topicToRender" in panel)
    assert (
        published()[diagnostics["topicToRender"]].type
        == message_class("diagnostic_msgs/msg/DiagnosticArray").__msgtype__
    )

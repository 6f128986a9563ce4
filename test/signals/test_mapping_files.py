"""A mapping file is understood or refused whole, with the key that is wrong."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

from ldcs_ros.signals import MappingError, guess_mapping, load_mapping
from ldcs_ros.signals import mapping as mapping_module
from ldcs_ros.signals.mapping import parse_mapping


def test_the_example_of_a_table_is_a_mapping(tmp_path):
    (tmp_path / "map.yaml").write_text(mapping_module.__doc__.split("column of times:\n\n", 1)[1])
    mapping = load_mapping(tmp_path / "map.yaml")
    assert mapping.time_column.column == "t" and mapping.time_column.scale == 1e-3
    assert mapping.commands[0].columns == ("p_left", "p_right")
    assert mapping.measurements[1].offset == mapping.ambient_pressure


def test_the_example_in_the_documentation_is_a_mapping(tmp_path):
    text = mapping_module.__doc__.split("\n\n", 1)[1].split("\n\nA table", 1)[0]
    (tmp_path / "map.yaml").write_text(re.sub(r"^    ", "", text, flags=re.MULTILINE))
    mapping = load_mapping(tmp_path / "map.yaml")
    assert [source.to for source in mapping.commands] == [
        "pressure_command",
        "pressure_command",
        "external_wrench",
    ]
    assert mapping.commands[0].scale == 100.0 and mapping.commands[0].arms == ("right", "left")
    assert mapping.commands[1].offset == 0.0 and mapping.commands[0].offset is None
    assert [source.to for source in mapping.measurements] == ["P0", "left/pressure", "P1.z"]
    assert mapping.measurements[0].scale == 1e-3 and mapping.measurements[1].index == 0


VALVES = {"topic": "/valves", "to": "pressure_command"}
TRACKER = {"topic": "/tracker", "to": "P0"}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "expected a mapping with keys out of"),
        ([], "expected a mapping with keys out of"),
        ({}, "nothing is mapped"),
        ({"command": []}, "unknown key 'command'"),
        ({"commands": {}}, "nothing is mapped"),
        ({"commands": "x"}, "expected a list @ commands"),
        ({"commands": ["x"]}, r"@ commands\[0\]"),
        ({"commands": [{"to": "pressure_command"}]}, "expected either topic or columns"),
        ({"commands": [{**VALVES, "columns": ["p"]}]}, "expected either topic or columns"),
        ({"commands": [{"to": "pressure_command", "columns": ["p"]}]}, "expected a topic, or time"),
        (
            {"commands": [VALVES], "time": {"column": "t"}},
            r"expected columns, as time names .* @ commands\[0\]",
        ),
        ({"commands": [VALVES], "time": {"name": "t"}}, "unknown key 'name'"),
        ({"commands": [{**VALVES, "to": "pressure"}]}, "expected one of .*pressure_command"),
        ({"commands": [{**VALVES, "unit": "mm"}]}, r"'mbar'.*@ commands\[0\].unit"),
        ({"commands": [{**VALVES, "arms": ["left", "left"]}]}, "one or more different arms"),
        ({"commands": [{**VALVES, "arms": []}]}, "one or more different arms"),
        ({"commands": [{**VALVES, "arms": [1]}]}, "expected text"),
        ({"commands": [{**VALVES, "absolute": "yes"}]}, "expected true or false"),
        ({"commands": [VALVES], "time": "now"}, "'log', 'stamp'"),
        ({"commands": [VALVES], "late": -1}, "at least 0"),
        ({"commands": [VALVES], "gap": 0}, "@ gap"),
        ({"measurements": [{**TRACKER, "to": "a/b"}]}, "expected a point such as P0"),
        ({"measurements": [{**TRACKER, "rotation": [0, 0, 0, 2]}]}, "unit quaternion"),
        (
            {"measurements": [{**TRACKER, "to": "P1.z", "rotation": [0, 0.6, 0, 0.8]}]},
            "reverses the axis of P1.z",
        ),
        ({"measurements": [{**TRACKER, "translation": [0, 0]}]}, "a list of 3 numbers"),
        ({"measurements": [{**TRACKER, "index": -1}]}, "at least 0"),
        ({"measurements": [{**TRACKER, "topic": 3}]}, "expected text"),
    ],
)
def test_a_wrong_key_or_value_is_named(content, reason):
    with pytest.raises(MappingError, match=reason) as caught:
        parse_mapping(content)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none_is_refused(tmp_path):
    (tmp_path / "bad.yaml").write_text("commands: [")
    with pytest.raises(MappingError, match="not valid YAML"):
        load_mapping(tmp_path / "bad.yaml")
    with pytest.raises(MappingError, match="No such file"):
        load_mapping(tmp_path / "none.yaml")


class Bag:
    """A recording's topics by type."""

    def __init__(self, **topics):
        self.topics = {name: SimpleNamespace(type=kind) for name, kind in topics.items()}


def test_our_own_names_need_no_file_and_a_bridges_report_of_its_rig_is_not_the_measurement():
    pose, fluid = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/FluidPressure"
    topics = {"/a/P0/pose": pose, "/a/rig/P0/pose": pose, "/a/truth/P0/pose": pose, "/a/left/pressure": fluid}
    driver = {"/trakstar_msg": "geometry_msgs/msg/TransformStamped", "/a/pressure_command": fluid}
    mapping = guess_mapping(Bag(**topics, **driver))
    found = {source.to: (source.topic, source.child) for source in mapping.measurements}
    assert found == {
        "P0": ("/a/P0/pose", ""),
        "P1": ("/trakstar_msg", "trakstar1"),
        "left/pressure": ("/a/left/pressure", ""),
    }
    assert not mapping.commands, "of another type"


def test_topics_in_a_namespace_are_commands_and_other_types_of_a_name_are_no_pressures():
    mapping = guess_mapping(
        Bag(
            **{
                "/rig/pressure_command": "std_msgs/msg/Float64MultiArray",
                "/rig/left/pressure": "geometry_msgs/msg/Vector3Stamped",
            }
        )
    )
    assert [source.topic for source in mapping.commands] == ["/rig/pressure_command"]
    assert not mapping.measurements


def test_a_table_begins_at_rest_under_its_first_row_and_a_bag_without_commands():
    measurement = {"to": "P1.x", "columns": ["x"]}
    table = parse_mapping({"time": {"column": "t"}, "measurements": [measurement]})
    assert table.initial == "held"
    assert parse_mapping({"measurements": [{"to": "P1", "topic": "/p"}]}).initial == "rest"
    with pytest.raises(MappingError, match="expected a point such as P0"):
        parse_mapping({"measurements": [{"to": "P1/x", "topic": "/p"}]})

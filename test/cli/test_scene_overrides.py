"""`--set path=value` changes single keys of a scene, and names a path that leads nowhere."""

from __future__ import annotations

import pytest

from ldcs_ros.cli.scene_argument import apply_overrides, parse_value, scene_with
from ldcs_ros.errors import SceneError

CONTENT = {
    "lattice": {"nodes": [9, 9]},
    "effects": [
        {"type": "springs", "stiffness": 80.0},
        {"type": "gravity"},
        {"type": "force", "at": "P0"},
        {"type": "force", "at": "P1"},
    ],
}


@pytest.mark.parametrize(
    ("override", "place", "value"),
    [
        ("lattice.nodes=[17, 17]", lambda c: c["lattice"]["nodes"], [17, 17]),
        ("lattice.nodes[1]=5", lambda c: c["lattice"]["nodes"], [9, 5]),
        ("effects[0].stiffness=139", lambda c: c["effects"][0]["stiffness"], 139),
        ("effects.springs.law=corotational", lambda c: c["effects"][0]["law"], "corotational"),
        (
            "effects.gravity.acceleration=[0, 0, -1.62]",
            lambda c: c["effects"][1]["acceleration"],
            [0, 0, -1.62],
        ),
        ("solver.accuracy=1e-6", lambda c: c["solver"]["accuracy"], 1e-6),
        ("title=a = b", lambda c: c["title"], "a = b"),
    ],
)
def test_a_value_lands_where_its_path_says(override, place, value):
    assert place(apply_overrides(CONTENT, [override])) == value


def test_the_content_it_is_given_stays_as_it_was():
    apply_overrides(CONTENT, ["lattice.nodes=[3, 3]", "effects[0].stiffness=1"])
    assert CONTENT["lattice"]["nodes"] == [9, 9] and CONTENT["effects"][0]["stiffness"] == 80.0


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("lattice.nodes", "is not path=value"),
        ("=3", "is not path=value"),
        ("effects[9].stiffness=1", "has 4 entries, got index 9"),
        ("effects.drag.density=1", "no entry of the type or name 'drag'"),
        ("effects.force.at=P0", "more than one entry of the type or name 'force'"),
        ("lattice.nodes.x=1", "scene.lattice.nodes"),
        ("effects[0].stiffness.x=1", "has no place 'x'"),
        ("effects[x].y=1", "cannot read the path"),
        ("lattice.nodes=[1", "not valid YAML"),
    ],
)
def test_a_path_that_leads_nowhere_is_named(override, complaint):
    with pytest.raises(SceneError) as refusal:
        apply_overrides(CONTENT, [override])
    assert complaint in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-6", 1e-6), ("4", 4), ("true", True), ("P1", "P1"), ("null", None), ("[1, 2]", [1, 2])],
)
def test_values_are_read_as_in_a_scene_file(text, value):
    assert parse_value(text) == value


def test_a_changed_scene_is_checked_as_a_whole(scene_file):
    assert scene_with(str(scene_file), ["effects.springs.stiffness=139"]).effect("springs").stiffness == 139.0
    with pytest.raises(SceneError) as refusal:
        scene_with(str(scene_file), ["effects.springs.stifness=139"])
    assert "Did you mean 'stiffness'" in str(refusal.value)

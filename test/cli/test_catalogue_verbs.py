"""`ldcs scenes` and `ldcs effects` list the tables that scenes are checked against."""

from __future__ import annotations

import dataclasses
import json

import pytest
import yaml

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.physics.effects import EFFECTS, effect_class


def test_scenes_lists_every_shipped_scene_with_its_title(ldcs):
    outcome = ldcs("scenes", "--json")
    listed = {scene["name"]: scene["title"] for scene in json.loads(outcome.out)["scenes"]}
    assert outcome.status == 0
    assert listed == {name: load_scene(name).title for name in shipped_scenes()}
    text = ldcs("scenes").out
    for name, title in listed.items():
        assert f"{name} " in text and title in text


def test_a_shown_scene_can_be_saved_and_loaded_again(ldcs, tmp_path):
    name = next(iter(shipped_scenes()))
    path = tmp_path / "copy.yaml"
    path.write_text(ldcs("scenes", "--show", name).out)
    assert load_scene(path).effects == load_scene(name).effects


def test_showing_an_unknown_scene_is_refused(refused):
    assert "no scene 'papr'" in refused("scenes", "--show", "papr")


def test_effects_describes_every_effect_with_units_bounds_and_origin(ldcs):
    outcome = ldcs("effects", "--json")
    listed = {effect["name"]: effect for effect in json.loads(outcome.out)["effects"]}
    assert list(listed) == list(EFFECTS)
    for name, effect in listed.items():
        fields = [field.name for field in dataclasses.fields(effect_class(name))]
        assert [parameter["name"] for parameter in effect["parameters"]] == fields
        assert effect["description"]
        for parameter in effect["parameters"]:
            assert parameter["help"] and parameter["origin"], (name, parameter)


def test_effects_prints_unit_default_and_bounds(ldcs):
    text = ldcs("effects", "springs").out
    assert "80 N/m" in text and "axial | axiswise | corotational" in text and "5 N s/m" in text


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_can_be_explained_alone(name, ldcs):
    outcome = ldcs("effects", name)
    assert outcome.status == 0 and outcome.out.startswith(f"{name}\n")


def test_an_unknown_effect_is_refused_with_the_nearest_one(refused):
    assert "did you mean 'gravity'" in refused("effects", "gravty")


def test_shipped_scenes_are_plain_yaml():
    for path in shipped_scenes().values():
        assert yaml.safe_load(path.read_text())["title"]

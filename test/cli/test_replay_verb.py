"""`ldcs replay` compares the result, makes other runs on request, and reports errors in one line."""

from __future__ import annotations

import json

import pytest
import yaml

from ldcs_ros.bags import BagWriter, read_bag


@pytest.fixture
def bag(ldcs, scene_file, tmp_path):
    assert ldcs("simulate", scene_file, "--duration", "0.2", "--bag", tmp_path / "bag").status == 0
    return tmp_path / "bag"


def copied(bag, folder, change):
    """Copy a bag with `change(message) -> message` applied to each message."""
    recording = read_bag(bag)
    with BagWriter(folder, topics=recording.topics, custom_data=recording.custom_data) as writer:
        for message in recording.in_order():
            writer.write(*change(message))
    return folder


def test_a_replay_says_that_the_bytes_are_the_same(ldcs, bag, tmp_path):
    outcome = ldcs("replay", bag, "--bag", tmp_path / "again")
    assert outcome.status == 0 and "the same bytes as the original" in outcome.out, outcome
    report = json.loads(ldcs("replay", bag, "--bag", tmp_path / "json", "--json").out)
    assert report["verdict"]["same_bytes"] and report["verdict"]["messages"] > 30
    assert read_bag(tmp_path / "again").custom_data["replay_of"] == "bag"


def test_a_difference_within_the_accuracy_passes_and_is_told(ldcs, bag, tmp_path):
    def nudge(message):
        # The last bit of the first coordinate of a cloud, as another platform might round it.
        if message.topic != "/ldcs/nodes" or not message.time:
            return message
        data = bytearray(message.cdr)
        data[-24 * 10] ^= 1
        return message._replace(cdr=bytes(data))

    other = copied(bag, tmp_path / "other", nudge)
    outcome = ldcs("replay", other, "--bag", tmp_path / "again")
    assert outcome.status == 0 and "passed: not the same bytes" in outcome.out, outcome.out
    assert "first difference" in outcome.out and "another processor, or changed code" in outcome.out


def test_a_difference_above_the_accuracy_fails_with_status_1(ldcs, bag, tmp_path):
    recording = read_bag(bag)
    wrong = recording.custom_data["scene_complete"].replace("mass: 0.01\n", "mass: 0.012\n")
    said = {**recording.custom_data, "scene_complete": wrong}
    with BagWriter(tmp_path / "wrong", topics=recording.topics, custom_data=said) as writer:
        for message in recording.in_order():
            writer.write(*message)
    outcome = ldcs("replay", tmp_path / "wrong", "--bag", tmp_path / "again")
    assert outcome.status == 1 and "FAILED: not the same bytes" in outcome.out


def test_another_scene_makes_another_run(ldcs, bag, tmp_path):
    words = ("replay", bag, "--bag", tmp_path / "lighter", "--set", "effects.payload.mass=0.005", "--json")
    report = json.loads(ldcs(*words).out)
    assert report["verdict"] is None
    assert yaml.safe_load(read_bag(tmp_path / "lighter").custom_data["scene"])["effects"][3]["mass"] == 0.005


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["none", "--bag", "new"], "no bag at"),
        (["bag"], "--bag"),
        (["bag", "--bag", "bag"], "exists already"),
        (["bag", "--bag", "new", "--map", "map.yaml"], "cannot read the mapping file"),
        (["bag", "--bag", "new", "--scene", "papr"], "papr"),
        (["bag", "--bag", "new", "--set", "effects.payload.mass=-1"], "mass"),
        (["foreign", "--bag", "new"], "--scene rig"),
        (["foreign", "--bag", "new", "--set", "title=x"], "name a scene with --scene"),
        (["foreign", "--bag", "new", "--scene", "rig"], "mapping file"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_and_nothing_is_written(
    refused, bag, tmp_path, monkeypatch, words, reason
):
    monkeypatch.chdir(tmp_path)
    source = read_bag(bag)
    with BagWriter("foreign", topics={}) as writer:
        for message in source.in_order(["/ldcs/P1/pose"]):
            writer.write(*message)
    assert reason in refused("replay", *words)
    assert not (tmp_path / "new").exists()

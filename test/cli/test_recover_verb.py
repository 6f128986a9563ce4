"""`ldcs recover` repairs the bag of a killed run."""

from __future__ import annotations

import json

from ldcs_ros.bags import read_bag


def a_bag(ldcs, scene_file, folder):
    assert ldcs("simulate", scene_file, "--duration", "0.2", "--bag", folder).status == 0
    return folder


def test_a_sound_bag_is_left_untouched(ldcs, scene_file, tmp_path):
    bag = a_bag(ldcs, scene_file, tmp_path / "bag")
    before = {path.name: path.read_bytes() for path in bag.iterdir()}
    outcome = ldcs("recover", bag)
    assert outcome.status == 0 and "sound" in outcome.out
    assert {path.name: path.read_bytes() for path in bag.iterdir()} == before


def test_a_cut_bag_can_be_read_again(ldcs, refused, scene_file, tmp_path):
    bag = a_bag(ldcs, scene_file, tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-1000])
    assert "recover" in refused("plot", bag)
    report = json.loads(ldcs("recover", bag, "--json").out)
    assert report["metadata_written"] and report["messages"] > 0 and not report["untouched"]
    assert read_bag(bag).count == report["messages"]


def test_a_missing_bag_is_refused(refused, tmp_path):
    assert str(tmp_path / "none") in refused("recover", tmp_path / "none")

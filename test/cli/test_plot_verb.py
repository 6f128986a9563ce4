"""`ldcs plot` draws a bag and refuses what is none."""

from __future__ import annotations

import json

import pytest
from PIL import Image


@pytest.fixture
def bag(ldcs, scene_file, tmp_path):
    folder = tmp_path / "bag"
    assert ldcs("simulate", scene_file, "--duration", "0.2", "--bag", folder).status == 0
    return folder


def test_pictures_appear_beside_the_bag(ldcs, bag):
    outcome = ldcs("plot", bag, "--times", "0.2")
    written = outcome.out.split()
    assert outcome.status == 0
    assert written == [f"{bag}_plots/{name}.png" for name in ("surface", "points", "drives")]
    for path in written:
        with Image.open(path) as image:
            assert image.format == "PNG" and image.width > 900 and len(image.getcolors(1 << 20)) > 20
    assert sorted(path.suffix for path in bag.iterdir()) == [".mcap", ".yaml"]


def test_print_is_asked_for_by_format_and_width(ldcs, bag, tmp_path):
    outcome = ldcs("plot", bag, "-o", tmp_path / "p", "--format", "svg", "--width", "column")
    assert outcome.out.split() == [f"{tmp_path}/p/{name}.svg" for name in ("surface", "points", "drives")]


def test_json_names_the_files_and_the_motion(ldcs, bag, tmp_path):
    outcome = ldcs("plot", bag, "-o", tmp_path / "p", "--animate", "gif", "--json")
    assert json.loads(outcome.out)["files"][-1] == str(tmp_path / "p" / "motion.gif")
    assert outcome.err == ""


def test_a_missing_bag_is_refused(refused, tmp_path):
    assert "none" in refused("plot", tmp_path / "none", "-o", tmp_path / "p")
    assert not (tmp_path / "p").exists()


def test_a_file_that_is_no_bag_is_refused(refused, scene_file):
    refused("plot", scene_file)


def test_a_time_outside_of_the_bag_is_refused(refused, bag, tmp_path):
    assert "0 ... 0.2 s" in refused("plot", bag, "--times", "5", "-o", tmp_path / "p")
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize("time", ["-1", "nan", "soon"])
def test_a_bad_time_is_refused(time, refused, bag):
    assert "time" in refused("plot", bag, f"--times={time}")


def test_a_folder_that_cannot_be_written_is_refused(refused, bag, tmp_path):
    (tmp_path / "file").write_text("")
    assert str(tmp_path / "file") in refused("plot", bag, "-o", tmp_path / "file")


def test_modes_of_a_scene_are_a_table_and_a_picture(ldcs, scene_file, tmp_path):
    outcome = ldcs("plot", scene_file, "--modes", "-o", tmp_path / "p", "--json")
    found = json.loads(outcome.out)
    assert outcome.status == 0 and found["files"] == [str(tmp_path / "p" / "modes.png")]
    assert len(found["frequencies"]) == len(found["damping"]) and sorted(found["frequencies"])[0] > 0.0
    with Image.open(found["files"][0]) as image:
        assert image.width > 900 and len(image.getcolors(1 << 20)) > 20


def test_what_draws_a_bag_does_not_go_with_modes(refused, scene_file, bag):
    assert "--modes" in refused("plot", scene_file, "--modes", "--times", "0.1")
    assert "--modes" in refused("plot", bag, "--set", "solver.accuracy=1e-4")

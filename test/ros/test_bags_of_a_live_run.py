"""The bag of a live run: one for each scene and reset; a disk that refuses ends the recording, not the run."""

from __future__ import annotations

import pytest

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.ros.sim.recording_session import RecordingSession
from ldcs_ros.twin.twin import Twin


class Logger(list):
    """Keeps the log."""

    def info(self, text):
        self.append(("info", text))

    def error(self, text):
        self.append(("error", text))


@pytest.fixture
def keeper(tmp_path):
    """A keeper that records a twin of the scene `single_spring` into a folder, and that twin."""
    kept = RecordingSession(Logger())
    twin = Twin(load_scene("single_spring"))
    kept.start(str(tmp_path / "bag"), twin, "/here")
    yield kept, twin
    kept.close()


def test_each_scene_and_each_reset_has_a_bag_that_says_what_it_is_of(keeper, tmp_path):
    kept, twin = keeper
    twin.advance_to(0.1)
    kept.start_next(twin)
    twin.reset()
    twin.advance_to(0.1)
    other = Twin(load_scene("hanging_sheet"))
    kept.change_twin(twin, other)
    other.advance_to(0.1)
    kept.start_next(other)
    other.reset()
    twin.advance_to(0.2)
    kept.close()
    named = {path.name: read_bag(path) for path in tmp_path.iterdir()}
    scenes = {name: bag.custom_data["scene_name"] for name, bag in named.items()}
    assert scenes == {
        "bag": "single_spring",
        "bag_reset1": "single_spring",
        "bag_scene1": "hanging_sheet",
        "bag_scene1_reset1": "hanging_sheet",
    }
    counts = {name: bag.counts.get("/here/nodes", 0) for name, bag in named.items()}
    assert counts == {"bag": 6, "bag_reset1": 6, "bag_scene1": 6, "bag_scene1_reset1": 0}
    assert not kept.error


def test_a_folder_that_exists_ends_the_recording_of_the_next_scene_and_nothing_else(keeper, tmp_path):
    kept, twin = keeper
    (tmp_path / "bag_scene1").mkdir()
    twin.advance_to(0.1)
    other = Twin(load_scene("hanging_sheet"))
    kept.change_twin(twin, other)
    other.advance_to(0.1)
    assert kept.recorder is None and "exists" in kept.error
    assert [level for level, _ in kept._logger] == ["info", "error"]
    assert read_bag(tmp_path / "bag").counts["/here/nodes"] == 6
    assert not list((tmp_path / "bag_scene1").iterdir())

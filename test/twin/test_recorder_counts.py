"""The number of messages that a run reports is the number that its bag holds."""

from __future__ import annotations

import shutil

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin


def test_a_disturbed_recording_counts_the_messages_of_its_rest(tmp_path):
    twin = Twin(load_scene("single_spring"), RunSettings())
    recorder = Recorder(tmp_path / "bag", twin)
    twin.sinks.append(recorder)
    twin.advance_to(0.2)
    shutil.rmtree(tmp_path / "bag")
    twin.advance_to(0.4)
    recorder.close()
    assert "disturbed" in recorder.error and recorder.folder != tmp_path / "bag"
    assert recorder.count == read_bag(recorder.folder).count > 0


def test_bags_are_named_by_scene_and_reset_and_hold_names_in_the_namespace(tmp_path):
    twin = Twin(load_scene("single_spring"), RunSettings(publish_clock=True, publish_tf=True))
    recorder = Recorder(tmp_path / "bag", twin, namespace="/lab")
    twin.sinks.append(recorder)
    twin.advance_to(0.02)
    folders = [recorder.folder.name]
    for change in (recorder.start_next, lambda: recorder.change_twin(twin), recorder.start_next):
        change()
        folders.append(recorder.folder.name)
    recorder.close()
    assert folders == ["bag", "bag_reset1", "bag_scene1", "bag_scene1_reset1"]
    topics = set(read_bag(tmp_path / "bag").topics)
    assert {"/lab/nodes", "/tf"} <= topics and "/lab//tf" not in topics

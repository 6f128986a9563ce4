"""What is shown of a bag is what was simulated: sheet, arms, and wrenches from schedule and commands."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.bags import Recording, read_bag
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.display.markers import MARKER_TOPICS
from ldcs_ros.signals.topics import recorded_scene
from ldcs_ros.signals.tracks import snapshots
from ldcs_ros.viewing.marker_bag import write_marker_bag


def test_each_recorded_surface_comes_with_the_arms_of_its_time(lift, recording):
    _folder, states = lift
    found = list(snapshots(recording, recorded_scene(recording)))
    assert len(found) == len(states)
    for snapshot in found:
        position, link_angle = states[round(snapshot.time * 1e-9, 6)]
        assert snapshot.nodes == (5, 4)
        assert snapshot.shown.position == pytest.approx(position, abs=1e-7)
        assert snapshot.shown.link_angle == pytest.approx(link_angle, abs=1e-12)


def test_wrenches_act_from_the_schedule_and_from_commands_on(recording):
    at = {round(m.time * 1e-9, 6): m.shown.wrenches for m in snapshots(recording, recorded_scene(recording))}
    assert at[0.08] == {}
    assert at[0.1]["P0_aligned"].force == (0.0, 0.2, 0.0)
    assert set(at[0.18]) == {"P0_aligned"}
    assert at[0.22]["P1"].torque == (0.0, 0.01, 0.0)


def test_a_bag_without_its_scene_still_shows_the_sheet(recording):
    bare = Recording.from_messages(recording.in_order())
    assert recorded_scene(bare) is None
    shown = next(snapshots(bare, None)).shown
    assert shown.position.shape == (40, 3)
    assert shown.link_angle.size == 0 and not shown.wrenches


def test_a_bag_without_a_surface_says_so(recording):
    poses = [m for m in recording.in_order() if m.topic.endswith("pose")]
    with pytest.raises(RecordingError, match="holds no topic 'nodes'"):
        next(snapshots(Recording.from_messages(poses), None))


def test_one_surface_out_of_many_is_taken_when_asked_for(recording):
    assert len(list(snapshots(recording, None, every=7))) == 3


def test_a_bag_with_markers_holds_all_that_it_held_and_what_viewers_draw(bag, recording, tmp_path):
    added = write_marker_bag(recording, tmp_path / "marked")
    marked = read_bag(tmp_path / "marked")
    assert added == 4 * 11 == sum(marked.counts[f"/ldcs/{topic}"] for topic in MARKER_TOPICS)
    kept = [m for m in marked.in_order() if m.topic.split("/")[-1] not in MARKER_TOPICS]
    assert kept == list(recording.in_order())
    assert dict(marked.custom_data) == dict(recording.custom_data)
    times = marked.channels["/ldcs/surface"].times
    assert np.diff(times).tolist() == [40_000_000] * 10
    last = {topic: marked.channels[f"/ldcs/{topic}"].raw[-1] for topic in MARKER_TOPICS}
    loads = decode(last["loads"].type, last["loads"].cdr)
    assert {"payload", "P0_aligned", "P1", "P1/torque"} <= {one.ns for one in loads.markers}
    traces = decode(last["traces"].type, last["traces"].cdr).markers
    assert {one.ns for one in traces[1:]} == {"P0", "P1"}


def test_markers_are_not_added_twice(recording, tmp_path):
    write_marker_bag(recording, tmp_path / "once")
    with pytest.raises(RecordingError, match="holds markers already"):
        write_marker_bag(read_bag(tmp_path / "once"), tmp_path / "twice")
    assert not (tmp_path / "twice").exists()


def test_markers_need_the_scene(recording, tmp_path):
    with pytest.raises(RecordingError, match="carries no scene"):
        write_marker_bag(Recording.from_messages(recording.in_order()), tmp_path / "never")

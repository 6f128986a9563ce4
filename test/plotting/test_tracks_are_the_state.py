"""Tracks read from a recording are what the simulation had, and what the sensors told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ldcs_ros.errors import RecordingError
from ldcs_ros.plotting.annotations import annotations_of
from ldcs_ros.signals.tracks import joint_tracks, point_tracks, pressure_tracks, seconds, surface_track


@pytest.fixture
def simulation(scene):
    simulation = scene.build()
    simulation.advance_to(0.4)
    return simulation


def test_the_surface_is_the_state_to_single_precision(recording, simulation):
    track = surface_track(recording)
    assert track.nodes == (5, 4) and len(track) == 21
    assert np.allclose(track.time, np.arange(21) / 50.0)
    last = track.position(track.index(0.4)).reshape(-1, 3)
    assert np.allclose(last, simulation.state.position, rtol=0.0, atol=1e-7)


def test_layers_and_columns_are_where_the_lattice_has_them(recording, simulation):
    position = surface_track(recording).position(-1)
    node = simulation.lattice.node("top", 4, 1)
    assert np.allclose(position[1, 4, 1], simulation.state.position[node], rtol=0.0, atol=1e-7)


def test_true_poses_and_measured_ones_are_told_apart(recording, simulation):
    truth, measured = point_tracks(recording, truth=True), point_tracks(recording, truth=False)
    assert sorted(truth) == ["P0", "P1"] and sorted(measured) == ["P1"]
    assert np.allclose(truth["P1"].last, simulation.pose("P1")[0], rtol=0.0, atol=1e-9)


def test_a_delayed_measurement_stands_at_the_time_when_it_was_true(recording):
    truth, measured = (point_tracks(recording, truth=flag)["P1"] for flag in (True, False))
    assert measured.time[0] == 0.0
    true_there = np.stack([np.interp(measured.time, truth.time, truth.value[:, k]) for k in range(3)], axis=1)
    # Noise of 0.1 mm, not the millimetres that the sheet moves in the 20 ms of delay.
    assert np.abs(measured.value - true_there).max() < 1.5e-3


def test_joints_and_pressures_are_read_with_their_names(recording, simulation):
    names, angle, torque = joint_tracks(recording)
    assert names == simulation.joint_names
    assert np.allclose(angle.last, simulation.state.joint_angle.ravel(), rtol=0.0, atol=1e-9)
    assert np.allclose(torque.last, simulation.joint_torque.ravel(), rtol=0.0, atol=1e-9)
    pressure = pressure_tracks(recording)
    assert sorted(pressure) == ["left", "right"]
    # Gauge: it starts at the pressure of the air.
    assert pressure["left"].first == pytest.approx(0.0, abs=1.0)


def test_a_recording_without_the_surface_is_refused_by_name(recording):
    bare = replace(
        recording, topics={name: info for name, info in recording.topics.items() if "nodes" not in name}
    )
    with pytest.raises(RecordingError, match="no topic 'nodes'"):
        surface_track(bare)


def test_wall_clock_stamps_count_from_the_start_and_simulation_stamps_from_zero():
    start = 1_790_000_000_000_000_000
    assert seconds(np.array([start + 500_000_000]), start).tolist() == [0.5]
    assert seconds(np.array([500_000_000]), 100_000_000).tolist() == [0.5]


def test_the_recorded_scene_tells_rest_shape_arms_and_loads(recording, scene):
    annotations = annotations_of(recording, surface_track(recording))
    assert annotations.title == scene.title
    assert np.array_equal(annotations.rest.reshape(-1, 3), scene.lattice.reference_position)
    rest = annotations.rest.reshape(-1, 3)
    ends = [[point.mean(rest)[1] for point in (line[0], line[-1])] for line in annotations.driven]
    side = annotations.rest[0, 0, -1, 1]
    np.testing.assert_allclose(ends, [[side, side], [-side, -side]])
    assert [load.mass for load in annotations.loads] == [0.010, 0.0]
    assert annotations.loads[1].force.tolist() == [0.0, 0.1, 0.0]


def test_a_recording_without_a_scene_can_still_be_drawn(recording):
    foreign = replace(recording, custom_data={})
    track = surface_track(foreign)
    annotations = annotations_of(foreign, track)
    assert annotations.loads == () and np.array_equal(annotations.rest, track.position(0))

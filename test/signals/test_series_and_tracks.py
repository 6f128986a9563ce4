"""Series are ordered, finite and never invented across a gap; tracks and snapshots follow the bag's own order."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros.bags import BagWriter, Recording, TopicInfo, read_bag
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.cdr import encode
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.scene.load import load_scene
from ldcs_ros.signals import mapping
from ldcs_ros.signals.run import run_of
from ldcs_ros.signals.series import (
    Series,
    at_times,
    clean,
    covered,
    curve,
    reference_is_first,
    resample_common,
    without_spikes,
)
from ldcs_ros.signals.signals import read_signals
from ldcs_ros.signals.topics import find_topic, guess_mapping
from ldcs_ros.signals.tracks import (
    cloud_nodes,
    cloud_positions,
    point_tracks,
    pressure_tracks,
    seconds,
    snapshots,
    surface_track,
)

sys.path.insert(0, str(Path(__file__).parents[1] / "replay"))
import rig_bag

MS = 1_000_000  # ns


def series(time, value, *, smooth=False):
    return Series(np.asarray(time, float), np.asarray(value, float)[:, None], ("",), "Pa", smooth)


def test_clean_sorts_and_drops_repeated_and_infinite_values():
    time = np.array([0.2, 0.0, 0.1, 0.1, 0.3])
    value = np.array([[2.0], [0.0], [1.0], [9.0], [np.nan]])
    times, values, dropped = clean(time, value)
    assert times.tolist() == [0.0, 0.1, 0.2] and values.ravel().tolist() == [0.0, 1.0, 2.0] and dropped == 2
    assert clean(np.zeros(0), np.zeros((0, 1)))[2] == 0


def test_a_curve_is_a_spline_through_smooth_values_and_lines_through_noisy_ones():
    time = np.linspace(0.0, 1.0, 11)
    cube = (time**3)[:, None]
    # A cubic spline repeats a cubic; a line between 0.4 and 0.5 is above it by h^2 f'' / 8.
    assert curve(time, cube, smooth=True)(np.array(0.45)) == pytest.approx(0.45**3, abs=1e-12)
    line = curve(time, cube, smooth=False)(np.array(0.45))
    assert line == pytest.approx(0.5 * (0.4**3 + 0.5**3), abs=1e-12)
    for smooth in (True, False):
        held = curve(time, cube, smooth=smooth)(np.array([-1.0, 2.0]))
        assert held.ravel() == pytest.approx([0.0, 1.0])
    assert curve(time[:1], cube[:1] + 5.0, smooth=True)(np.array([3.0, 4.0])).ravel().tolist() == [5.0, 5.0]
    assert curve(time[:3], cube[:3], smooth=True)(np.array(0.05)) == pytest.approx(0.5 * 0.1**3)


def test_values_at_their_own_times_are_the_values_and_not_those_of_a_curve():
    time, value = np.array([0.0, 0.1, 0.2]), np.array([[1.0], [5.0], [2.0]])

    def never(asked):
        raise AssertionError

    asked = np.array([0.1 + 1e-9, 0.2 - 1e-9])
    assert at_times(time, value, asked, never).ravel().tolist() == [5.0, 2.0]
    assert at_times(time, value, np.array([0.1, 0.15]), lambda t: t + 7.0).tolist() == [7.1, 7.15]


def test_the_noisier_side_or_else_the_sparser_one_gives_the_times():
    dense, sparse = series(np.arange(11) * 0.1, np.arange(11)), series(np.arange(6) * 0.2, 2.0 * np.arange(6))
    smooth = series(np.arange(11) * 0.1, np.arange(11), smooth=True)
    assert reference_is_first(sparse, dense) and not reference_is_first(dense, sparse)
    assert reference_is_first(dense, smooth) and not reference_is_first(smooth, dense)
    assert reference_is_first(dense, dense)
    times, a, b, skipped = resample_common(dense, sparse, 0.0)
    assert times.tolist() == sparse.time.tolist() and skipped == 0
    np.testing.assert_allclose(a, b, atol=1e-12)
    few, *_ = resample_common(dense, sparse, 0.0, most=3)
    np.testing.assert_allclose(few, [0.0, 0.4, 1.0])


@pytest.mark.parametrize("a_is_sparse", [True, False])
def test_an_offset_moves_b_on_the_clock_of_a(a_is_sparse):
    # B shows 10 t + 3 at its own time t + 0.25; on A's clock it equals A.
    step = (0.2, 0.1) if a_is_sparse else (0.1, 0.2)
    time_a, time_b = np.arange(0.0, 2.01, step[0]), np.arange(0.0, 2.01, step[1])
    a = series(time_a, 10.0 * time_a + 3.0)
    b = series(time_b + 0.25, 10.0 * time_b + 3.0)
    times, left, right, skipped = resample_common(a, b, 0.25)
    assert skipped == 0 and times[0] == pytest.approx(0.0) and times[-1] == pytest.approx(2.0)
    np.testing.assert_allclose(left, right, atol=1e-9)
    np.testing.assert_allclose(left.ravel(), 10.0 * times + 3.0, atol=1e-9)


def test_nothing_is_made_up_inside_a_gap_of_more_than_five_periods():
    time = np.concatenate([np.arange(0.0, 1.0, 0.1), np.arange(1.6, 2.5, 0.1)])
    other = series(time, time)
    lead = series(np.arange(0.05, 2.4, 0.25), np.zeros(10), smooth=False)
    times, _, at, skipped = resample_common(lead, other, 0.0)
    assert skipped == 3  # at 1.05, 1.3 and 1.55 s
    np.testing.assert_allclose(at.ravel(), times, atol=1e-12)
    narrow = series(np.delete(time, [3, 4, 5]), np.delete(time, [3, 4, 5]))  # four periods are bridged
    assert resample_common(lead, narrow, 0.0)[3] == 3


def pose(time, place):
    kind = "geometry_msgs/msg/"
    point = rig_bag.build(f"{kind}Point", x=place[0], y=place[1], z=place[2])
    turn = rig_bag.build(f"{kind}Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return rig_bag.build(
        f"{kind}PoseStamped",
        header=rig_bag.header(time),
        pose=rig_bag.build(f"{kind}Pose", position=point, orientation=turn),
    )


def cloud(time, places, *, big=False):
    kind = "sensor_msgs/msg/"
    order = ">" if big else "<"
    rows = np.zeros(
        len(places), np.dtype([("pad", "u4"), ("z", order + "f4"), ("x", order + "f4"), ("y", order + "f4")])
    )
    for axis, column in zip("xyz", np.asarray(places, float).T, strict=True):
        rows[axis] = column
    offsets = {"x": 8, "y": 12, "z": 4}
    fields = [
        rig_bag.build(f"{kind}PointField", name=axis, offset=offsets[axis], datatype=7, count=1)
        for axis in "xyz"
    ]
    return rig_bag.build(
        f"{kind}PointCloud2", header=rig_bag.header(time), height=4, width=len(places) // 4, fields=fields,
        is_bigendian=big, point_step=16, row_step=4 * len(places), is_dense=True,
        data=np.frombuffer(rows.tobytes(), np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize("big", [False, True])
def test_a_cloud_is_read_by_the_offsets_and_the_byte_order_of_its_fields(big):
    places = np.arange(24.0).reshape(8, 3)
    assert np.array_equal(cloud_positions(cloud(0, places, big=big)), places)


def test_the_shortest_path_of_a_name_is_the_twins_own(tmp_path):
    messages = [
        ("/rig/P1/pose", 10 * MS, pose(10 * MS, [9.0, 0.0, 0.0])),
        ("/P1/pose", 10 * MS, pose(10 * MS, [1.0, 2.0, 3.0])),
        ("/truth/P1/pose", 10 * MS, pose(20 * MS, [4.0, 5.0, 6.0])),
        ("/rig/left/pressure", 10 * MS, rig_bag.fluid(10 * MS, 101332.0)),
        ("/left/pressure", 10 * MS, rig_bag.fluid(10 * MS, 101333.0)),
        ("/pressure", 10 * MS, rig_bag.fluid(10 * MS, 101334.0)),
    ]
    recording = read_bag(rig_bag.write(tmp_path / "bag", messages))
    measured, truth = point_tracks(recording, truth=False), point_tracks(recording, truth=True)
    assert measured["P1"].first.tolist() == [1.0, 2.0, 3.0] and list(measured) == ["P1"]
    assert truth["P1"].last.tolist() == [4.0, 5.0, 6.0] and truth["P1"].time == pytest.approx([0.02])
    assert {arm: track.value.tolist() for arm, track in pressure_tracks(recording).items()} == {"left": [8.0]}
    assert find_topic(recording, "pose", "geometry_msgs/msg/PoseStamped") == "/P1/pose"
    guessed = guess_mapping(recording)
    assert {source.to: source.topic for source in guessed.measurements} == {
        "P1": "/P1/pose", "left/pressure": "/left/pressure"
    }  # fmt: skip
    assert guessed.commands == ()


SCENE = {
    "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [2, 2], "mass": 0.1},
    "points": {"P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs"},
        {"type": "clamp"},
        {"type": "arms", "links": 2, "width": 0},
        {"type": "wrench"},
    ],
    "inputs": [{"time": 0.025, "wrench": {"frame": "P1", "force": [0.0, 0.0, 3.0]}}],
}


def test_a_snapshot_has_the_arms_of_its_time_and_all_wrenches_up_to_it(tmp_path):
    flat = np.zeros((8, 3))
    messages = []
    for k in (1, 2, 3):
        time = k * 10 * MS
        messages += [("/nodes", time, cloud(time, flat + k)), ("/joint_states", time, joints(time, k))]
    messages.insert(
        4, ("/external_wrench", 20 * MS, rig_bag.wrench(20 * MS, "twin/P1_aligned", [0.0, 1.0, 0.0]))
    )
    recording = read_bag(rig_bag.write(tmp_path / "bag", messages))
    found = list(snapshots(recording, load_scene(SCENE)))
    assert [snapshot.time for snapshot in found] == [10 * MS, 20 * MS, 30 * MS]
    for k, snapshot in enumerate(found, start=1):
        assert snapshot.nodes == (2, 2) and np.array_equal(snapshot.shown.position, flat + k)
        # Joint angles 0.1 k and 0.2 k of the left arm add up along its links, half as much at the right.
        np.testing.assert_allclose(snapshot.shown.link_angle, k * np.array([[0.1, 0.3], [0.05, 0.15]]))
    sent, scheduled = Wrench((0.0, 1.0, 0.0)), Wrench((0.0, 0.0, 3.0))
    assert found[0].shown.wrenches == {}
    assert found[1].shown.wrenches == {"P1_aligned": sent}
    assert found[2].shown.wrenches == {"P1_aligned": sent, "P1": scheduled}
    assert [snapshot.time for snapshot in snapshots(recording, None, every=2)] == [10 * MS, 30 * MS]
    bare = next(snapshots(recording, None))
    assert bare.shown.wrenches == {} and bare.shown.link_angle.size == 0


def joints(time, k):
    angles = k * np.array([0.1, 0.2, 0.05, 0.1])
    names = [f"{arm}_joint_{n}" for arm in ("left", "right") for n in (1, 2)]
    return rig_bag.build(
        "sensor_msgs/msg/JointState", header=rig_bag.header(time), name=names, position=angles, velocity=angles,
        effort=angles,
    )  # fmt: skip


def test_clouds_of_two_sizes_and_clouds_without_coordinates_are_refused(tmp_path):
    small, large = cloud(10 * MS, np.ones((8, 3))), cloud(20 * MS, np.ones((12, 3)))
    recording = read_bag(
        rig_bag.write(tmp_path / "bag", [("/nodes", 10 * MS, small), ("/nodes", 20 * MS, large)])
    )
    track = surface_track(recording)
    assert np.array_equal(track.position(0), np.ones((2, 2, 2, 3)))
    with pytest.raises(RecordingError, match="differ in size"):
        track.position(1)
    bare = cloud(0, np.ones((8, 3)))
    bare.fields = bare.fields[:2]
    with pytest.raises(RecordingError, match=r"has the fields \['x', 'y'\]"):
        cloud_positions(bare)
    whole = cloud(0, np.ones((8, 3)))
    whole.fields[1].datatype = 5
    with pytest.raises(RecordingError, match="expected x, y, z as float32"):
        cloud_positions(whole)


def test_two_values_show_no_gap_and_a_value_at_its_own_time_is_in_none():
    far = series([0.0, 10.0], [0.0, 10.0])
    assert resample_common(series([5.0, 6.0], [0.0, 0.0]), far, 0.0)[3] == 0
    # At 1.5 s a lone value between two gaps of 1 s, with periods of 0.1 s else.
    time = np.concatenate([np.arange(0.0, 0.55, 0.1), [1.5], np.arange(2.5, 3.05, 0.1)])
    for late in (0.0, 1e-9, -1e-9):
        asked = series([0.25, 1.0, 1.5 + late, 2.0], np.zeros(4))
        times, *_, skipped = resample_common(asked, series(time, time), 0.0)
        assert times.tolist() == [0.25, 1.5 + late] and skipped == 2


def test_a_wall_clock_is_told_from_a_simulations_by_ten_years():
    year = 365 * 86_400 * 10**9
    assert seconds(np.array([9 * year]), 8 * year)[0] == pytest.approx(9 * 365 * 86_400.0)
    assert seconds(np.array([11 * year]), 10 * year)[0] == pytest.approx(365 * 86_400.0)


def test_a_twins_own_bag_has_gauge_pressures_truths_and_the_nearest_cloud(tmp_path):
    messages = [("/left/pressure", 10 * MS, rig_bag.fluid(10 * MS, 51_325.0))]
    for k in (1, 2, 3):
        messages.append(("/truth/P1/pose", k * 10 * MS, pose(k * 10 * MS, [0.1 * k, 0.0, 0.0])))
        messages.append(("/nodes", k * 10 * MS, cloud(k * 10 * MS, np.full((8, 3), float(k)))))
    recording = read_bag(rig_bag.write(tmp_path / "bag", messages))
    found = read_signals(recording, name="run", mapping=None, measured=False)
    assert found.series["left/pressure"].value == pytest.approx(-50_000.0) and found.in_simulation_time
    assert found.series["P1"].value[:, 0] == pytest.approx([0.1, 0.2, 0.3]) and found.series["P1"].smooth
    track = surface_track(recording)
    assert [track.index(time) for time in (0.0, 0.0149, 0.021, 9.0)] == [0, 0, 1, 2]


def test_a_bag_that_starts_more_than_ten_years_after_1970_has_a_wall_clock(tmp_path):
    year = 365 * 86_400 * 10**9
    for years, simulated in ((9.9, True), (10.5, False)):
        start = round(years * year)
        message = ("/truth/P1/pose", start, pose(start, [1.0, 0.0, 0.0]))
        recording = read_bag(rig_bag.write(tmp_path / f"{years}", [message]))
        found = read_signals(recording, name="run", mapping=None, measured=False)
        assert found.in_simulation_time is simulated


def test_a_pose_without_a_stamp_has_its_log_time_on_a_wall_clock_alone(tmp_path):
    wall = rig_bag.WALL
    messages = [("/P1/pose", wall + k * 10 * MS, pose(0, [float(k), 0.0, 0.0])) for k in range(3)]
    recording = read_bag(rig_bag.write(tmp_path / "rig", messages))
    assert point_tracks(recording, truth=False)["P1"].time == pytest.approx([0.0, 0.01, 0.02])
    stamped = [("/P1/pose", wall + k * 10 * MS, pose(wall + k * 20 * MS, [0.0, 0.0, 0.0])) for k in range(3)]
    recording = read_bag(rig_bag.write(tmp_path / "stamped", stamped))
    assert point_tracks(recording, truth=False)["P1"].time == pytest.approx([0.0, 0.02, 0.04])


@pytest.mark.parametrize(("height", "width"), [(2, 4), (5, 2), (4, 1)])
def test_a_cloud_that_is_no_sheet_is_refused(height, width):
    shown = cloud(0, np.ones((8, 3)))
    shown.height, shown.width = height, width
    with pytest.raises(RecordingError, match="expected both layers of a sheet"):
        cloud_nodes(shown)


def test_units_are_their_factors_to_si():
    factors = {
        "PRESSURE": {"Pa": 1.0, "kPa": 1e3, "mbar": 100.0, "bar": 1e5, "psi": 6894.757},
        "TORQUE": {"N m": 1.0, "mN m": 1e-3},
        "FORCE": {"N": 1.0, "mN": 1e-3},
        "ANGLE": {"rad": 1.0, "deg": np.pi / 180.0},
        "LENGTH": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    }
    for name, known in factors.items():
        table = getattr(mapping, name)
        for unit in known.keys() & table.keys():
            assert table[unit] == pytest.approx(known[unit], rel=1e-6), unit
        assert len(known.keys() & table.keys()) >= 2
    source = mapping.MeasurementSource("/t", "P0")
    assert (
        source.rotation == (0.0, 0.0, 0.0, 1.0)
        and source.translation == (0.0, 0.0, 0.0)
        and source.scale == 1.0
    )


def test_a_topic_without_messages_is_not_found(tmp_path):
    kind = "sensor_msgs/msg/FluidPressure"
    writer = BagWriter(
        tmp_path / "bag", topics={"/left/pressure": TopicInfo(kind), "/a/left/pressure": TopicInfo(kind)}
    )
    writer.write("/a/left/pressure", kind, encode(rig_bag.fluid(10 * MS, 101328.0)), 10 * MS)
    writer.close()
    recording = read_bag(tmp_path / "bag")
    assert find_topic(recording, "pressure", kind) == "/a/left/pressure"
    assert pressure_tracks(recording)["left"].value.tolist() == [3.0]


def test_a_value_alone_far_from_its_neighbours_is_dropped_and_noise_and_fast_motion_stay():
    noise = np.random.default_rng(3).normal(0.0, 1.0, 60)
    time = np.arange(60) * 0.01
    assert without_spikes(series(time, noise), 0.0).time.tolist() == time.tolist()
    lone = noise.copy()
    lone[20] += 40.0
    assert without_spikes(series(time, lone), 0.0).value.ravel().tolist() == np.delete(noise, 20).tolist()
    # A distance that the caller calls small stays, and so do two values: a fast motion has several.
    assert len(without_spikes(series(time, lone), 50.0).time) == 60
    pair = lone.copy()
    pair[21] += 40.0
    assert len(without_spikes(series(time, pair), 0.0).time) == 60
    # Nothing is known on one side of the last two values of each end.
    for k in (0, 1, 58, 59):
        end = noise.copy()
        end[k] += 40.0
        assert len(without_spikes(series(time, end), 0.0).time) == 60


@pytest.mark.parametrize("change", [{"data": np.zeros(127, np.uint8)}, {"row_step": 31}, {"point_step": 15}])
def test_a_cloud_with_fewer_bytes_than_it_claims_is_refused(change):
    short = cloud(0, np.ones((8, 3)))
    for name, value in change.items():
        setattr(short, name, value)
    with pytest.raises(RecordingError, match="does not fit into its"):
        cloud_positions(short)


def test_only_transforms_of_the_trackers_own_topic_are_guessed_to_be_points(tmp_path):
    elsewhere = rig_bag.transform(MS, "trakstar0", [0.0, 0.0, 0.0])
    other_type = rig_bag.array([1.0])
    recording = read_bag(
        rig_bag.write(tmp_path / "bag", [("/tool", MS, elsewhere), ("/my_trakstar_msg", MS, other_type)])
    )
    assert guess_mapping(recording).measurements == ()


def test_a_bag_with_invalid_run_settings_says_so():
    settings = {"ambient_pressure": "much"}
    with pytest.raises(RecordingError, match="has settings that are none"):
        pressure_tracks(Recording.from_messages([], custom_data=settings))


def test_a_run_without_clouds_has_no_node_positions(tmp_path):
    pressures = [("/left/pressure", k * MS, rig_bag.fluid(k * MS, 1.5e5)) for k in range(1, 4)]
    run = run_of(read_bag(rig_bag.write(tmp_path / "bag", pressures)), None)
    assert run.node_time.shape == (0,) and run.nodes.shape == (0, 2, 0, 0, 3)


def test_a_single_value_holds_at_its_own_time_and_past_the_last_value_no_silence_is_known():
    alone = curve(np.array([2.0]), np.array([[5.0]]), smooth=False)
    assert alone(np.array([1.0, 2.0, 3.0])).ravel().tolist() == [5.0, 5.0, 5.0]
    assert covered(np.array([0.0, 0.1, 0.2]), np.array([-1.0, 0.15, 0.3])).tolist() == [True, True, True]


def test_joints_of_a_twin_are_smooth_and_its_commands_hold_until_the_next_one(tmp_path):
    messages = [("/joint_states", k * 10 * MS, joints(k * 10 * MS, k)) for k in range(1, 6)]
    messages += [("/truth/P1/pose", k * 10 * MS, pose(k * 10 * MS, [0.1 * k, 0.0, 0.0])) for k in (1, 2, 3)]
    messages += [
        ("/pressure_command", 20 * MS, rig_bag.array([10e3, 20e3])),
        ("/pressure_command", 40 * MS, rig_bag.array([30e3, 0.0])),
    ]
    recording = read_bag(rig_bag.write(tmp_path / "bag", messages))
    found = read_signals(recording, name="run", mapping=None, measured=False)
    joint = [series for name, series in found.series.items() if name.startswith("joint/")]
    assert joint and all(series.smooth and series.unit == "rad" for series in joint)
    run = run_of(recording, None)
    commands = [values for name, values in run.channels.items() if name.startswith("pressure_command.")]
    # Times count from the first message, at 10 ms.
    expected = np.where(run.time < 0.0299, 10e3, 30e3)
    np.testing.assert_allclose(commands[0][run.time > 0.0099], expected[run.time > 0.0099])

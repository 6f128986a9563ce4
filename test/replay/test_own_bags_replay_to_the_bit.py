"""A bag that this project wrote replays to the same bytes, whatever was commanded and whenever."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ldcs_ros.bags import BagWriter, TopicInfo, read_bag
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.messages import pressure_command, torque_command, wrench_command
from ldcs_ros.replay.session import Changes, replay
from ldcs_ros.ros.sim.pacing import Pacer
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.twin.twin import Twin
from ldcs_ros.twin.watchdog import Watchdog

NOTHING = (0.0, 0.0, 0.0)


def same(folder, tmp_path, **keywords):
    """Replay a bag and return the outcome; fails unless every byte is the same."""
    done = replay(folder, tmp_path / f"again_{folder.name}", **keywords)
    assert done.verdict.same_bytes, done.verdict
    assert done.verdict.messages > 20 and done.verdict.passed
    return done


def test_commands_act_again_at_the_very_time_at_which_they_acted(recorded, pneumatic, tmp_path):
    # Rates whose periods are no whole nanoseconds, and commands at times that are no events.
    unusual = {"publish_clock": True, "publish_tf": True, "ambient_pressure": 9.7e4}
    with recorded(pneumatic, publish_rate=60.0, tracker_rate=70.0, seed=5, accuracy=3e-5, **unusual) as twin:
        twin.receive("pressure_command", pressure_command([1e4, 2e4]))
        twin.advance_to(1.0 / 3.0)
        twin.receive("pressure_command", pressure_command([8e4]))
        twin.receive("external_wrench", wrench_command(0, "P1", (0.0, 0.0, 0.1), NOTHING))
        twin.advance_to(0.1 * np.pi * 1.2)
        twin.receive("external_wrench", wrench_command(0, "node_top_1_1_aligned", (0.1, 0.0, 0.0), NOTHING))
        twin.receive("pressure_command", pressure_command([float("nan")]))
        twin.advance_to_report()
        twin.receive("external_wrench", wrench_command(0, "P1", NOTHING, NOTHING))
        twin.advance_to(0.7)
    done = same(tmp_path / "original", tmp_path)
    assert done.outcome.applied == 5 and not done.outcome.refused
    assert read_bag(tmp_path / "original").custom_data["scene_complete"] == done.twin.scene.text


def test_a_vent_is_replayed_from_what_it_commanded(recorded, motorised, tmp_path):
    clock = [0.0]
    watchdog = Watchdog(lambda: clock[0], timeout=0.3, wrench_timeout=0.2)
    with recorded(motorised, watchdog=watchdog) as twin:
        names = twin.simulation.joint_names
        twin.advance_to(0.02)
        twin.receive("torque_command", torque_command(0, names[:3], np.array([0.02, 0.03, 0.04])))
        twin.receive("external_wrench", wrench_command(0, "P0", (0.0, 0.1, 0.0), (1e-3, 0.0, 0.0)))
        twin.advance_to(0.3)
        clock[0] = 1.0
        assert twin.check_watchdog()
        twin.advance_to(1.0)
        assert not twin.simulation.inputs.torque.any()
    assert same(tmp_path / "original", tmp_path).outcome.applied > 25


def test_a_run_from_rest_begins_at_rest_again(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        pass
    assert read_bag(tmp_path / "original").custom_data["settled"] == "false"
    twin = Twin(pneumatic)
    twin.settle()
    with recorded_from(twin, tmp_path / "rest"):
        twin.advance_to(0.2)
        twin.receive("pressure_command", pressure_command([0.0]))
        twin.advance_to(0.4)
    assert same(tmp_path / "rest", tmp_path).twin.settings.settled


def test_each_bag_of_a_run_with_resets_replays(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        for pressure in (2e4, 3e4):
            twin.advance_to(0.1)
            twin.receive("pressure_command", pressure_command([pressure]))
            twin.advance_to(0.3)
            twin.recorder.start_next()
            twin.reset()
        twin.advance_to(0.3)
    for name in ("original", "original_reset1", "original_reset2"):
        same(tmp_path / name, tmp_path)


def test_a_run_commanded_live_from_another_thread_replays(recorded, pneumatic, tmp_path):
    with recorded(pneumatic, watchdog=Watchdog(time.monotonic, timeout=0.15), diagnostics=False) as twin:
        runner = Runner(
            twin,
            Pacer(1.0, tolerance=0.02),
            on_failure=lambda reason: None,
            on_finish=lambda: None,
            on_reset=lambda: None,
        )
        runner.start()
        runner.call(runner.resume)
        for k in range(8):
            time.sleep(0.031)
            runner.post("pressure_command", pressure_command([1e4 * k, 2e3 * k]))
        runner.call(runner.pause)
        runner.post("external_wrench", wrench_command(0, "P1", (0.0, 0.0, 0.2), NOTHING))
        runner.call(runner.step)
        runner.call(runner.resume)
        time.sleep(0.4)
        assert twin.watchdog.tripped
        runner.stop()
    assert threading.active_count() < 10
    assert same(tmp_path / "original", tmp_path).outcome.applied > 15


STEP = st.tuples(
    st.floats(0.0, 0.08),
    st.one_of(
        st.tuples(st.just("pressure"), st.floats(0.0, 9e4), st.floats(0.0, 9e4)),
        st.tuples(st.just("wrench"), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
        st.tuples(st.just("vent"), st.sampled_from([0.0, 0.05]), st.just(0.0)),
    ),
)


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(STEP, min_size=2, max_size=6))
def test_whatever_is_commanded_replays(recorded, pneumatic, tmp_path_factory, steps):
    folder = tmp_path_factory.mktemp("commands")
    with recorded(pneumatic, folder / "bag") as twin:
        for wait, (kind, one, two) in steps:
            twin.advance_to(twin.time + wait)
            if kind == "pressure":
                twin.receive("pressure_command", pressure_command([one, two]))
            elif kind == "wrench":
                twin.receive("external_wrench", wrench_command(0, "P1_aligned", (one, 0.0, two), NOTHING))
            else:
                twin.vent(one)
        twin.advance_to(twin.time + 0.2)
    done = replay(folder / "bag", folder / "again")
    assert done.verdict.same_bytes, done.verdict


@pytest.mark.parametrize("known", ["schedule", "held"])
def test_a_bag_says_whether_a_schedule_was_followed_smoothly(recorded, pneumatic, tmp_path, known):
    inputs = [{"time": 0.01 * k, "pressure": float(4e4 * (1.0 - np.cos(0.04 * k)))} for k in range(40)]
    with recorded(pneumatic.edited(inputs=inputs), known_commands=known) as twin:
        twin.advance_to(0.25)
        twin.receive("pressure_command", pressure_command([3e4]))
        twin.advance_to(0.35)
    assert (twin.simulation.statistics.steps < 30) == (known == "schedule")
    assert read_bag(tmp_path / "original").custom_data["known_commands"] == known
    assert same(tmp_path / "original", tmp_path).twin.settings.known_commands == known


def test_commands_alone_are_enough(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.1)
        twin.receive("pressure_command", pressure_command([9e4]))
        twin.advance_to(0.3)
    original = read_bag(tmp_path / "original")
    topic = "/ldcs/pressure_command"
    custom_data, info = original.custom_data, {topic: TopicInfo(original.topics[topic].type)}
    with BagWriter(tmp_path / "filtered", topics=info, custom_data=custom_data) as writer:
        for message in original.in_order([topic]):
            writer.write(*message)
    done = replay(tmp_path / "filtered", tmp_path / "again", changes=Changes(duration=0.3))
    again = read_bag(tmp_path / "again")
    topics = sorted(set(original.topics) - {"/diagnostics"})
    assert list(again.in_order(topics)) == list(original.in_order(topics)) and done.verdict is None


def test_a_replay_replays(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.2)
    same(tmp_path / "original", tmp_path)
    assert same(tmp_path / "again_original", tmp_path).verdict.messages > 20


@pytest.mark.parametrize("change", [Changes(seed=9), Changes(accuracy=1e-3), Changes(duration=0.1)])
def test_another_run_by_intent_gets_no_verdict(recorded, pneumatic, tmp_path, change):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.2)
    assert replay(tmp_path / "original", tmp_path / "other", changes=change).verdict is None


def recorded_from(twin, folder):
    """Return a recorder of a twin as it stands, attached."""
    from contextlib import closing

    from ldcs_ros.twin.recorder import Recorder

    recorder = Recorder(folder, twin)
    twin.sinks.append(recorder)
    return closing(recorder)


def test_a_bag_that_was_cut_off_replays_as_far_as_it_goes(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.1)
        twin.receive("pressure_command", pressure_command([9e4]))
        twin.advance_to(0.3)
    original = read_bag(tmp_path / "original")
    with BagWriter(tmp_path / "cut", topics=original.topics, custom_data=original.custom_data) as writer:
        for message in list(original.in_order())[:-3]:
            writer.write(*message)
    same(tmp_path / "cut", tmp_path)


def with_settings(folder, original, **texts):
    said = {**original.custom_data, **texts}
    with BagWriter(folder, topics=original.topics, custom_data=said) as writer:
        for message in original.in_order():
            writer.write(*message)
    return folder


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("publish_rate", "1e12"),
        ("publish_rate", "nan"),
        ("tracker_rate", "1e9"),
        ("seed", "-3"),
        ("seed", "x"),
    ]
    + [("ambient_pressure", "inf")],
)
def test_settings_out_of_bounds_are_refused_before_the_run(recorded, pneumatic, tmp_path, setting, text):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.05)
    bag = with_settings(tmp_path / "hostile", read_bag(tmp_path / "original"), **{setting: text})
    with pytest.raises(RecordingError, match=r"custom_data of .*hostile cannot be read"):
        replay(bag, tmp_path / "again")
    assert not (tmp_path / "again").exists()


def test_a_replay_that_lacks_surfaces_of_the_original_fails(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        twin.advance_to(0.1)
    bag = with_settings(tmp_path / "slower", read_bag(tmp_path / "original"), publish_rate="10.0")
    verdict = replay(bag, tmp_path / "again").verdict
    assert not verdict.passed and verdict.largest == np.inf


def test_a_copy_in_sqlite3_replays_like_the_original(recorded, pneumatic, tmp_path):
    with recorded(pneumatic) as twin:
        for k in range(5):
            twin.advance_to(0.05 * k)
            twin.receive("pressure_command", pressure_command([2e4 * k]))
        twin.advance_to(0.3)
    original, store = read_bag(tmp_path / "original"), get_typestore(Stores.ROS2_KILTED)
    with Writer(tmp_path / "copy", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for key, value in original.custom_data.items():
            writer.set_custom_data(key, value)
        connections = {
            topic: writer.add_connection(topic, info.type, typestore=store)
            for topic, info in original.topics.items()
        }
        for message in original.in_order():
            writer.write(connections[message.topic], message.time, message.cdr)
    assert same(tmp_path / "copy", tmp_path).outcome.applied == 5


def test_wrenches_that_act_for_a_while_are_replayed_from_what_they_commanded(recorded, pneumatic, tmp_path):
    # Reports at 60 Hz are no whole nanoseconds; 1/3 s and its stairs meet them, at either side.
    push = {"point": "P1", "force": (0.0, 0.0, 0.4), "torque": (0.0, 1e-3, 0.0)}
    with recorded(pneumatic, publish_rate=60.0, full_precision=True, frame_prefix="twin1/") as twin:
        twin.advance_to(1.0 / 60.0)
        twin.apply_wrench(**push, frame_id="twin1/ldcs_base", duration=1.0 / 3.0, ramp=1.0 / 30.0)
        twin.advance_to(0.1)
        twin.apply_wrench(**push, frame_id="P1", duration=0.0, ramp=0.1)
        twin.receive("pressure_command", pressure_command([3e4]))
        twin.advance_to(0.15)
        twin.apply_wrench(**{**push, "force": (0.0, 0.0, -0.2)}, frame_id="P1", duration=0.2, ramp=0.0)
        twin.advance_to(0.45)
    done = same(tmp_path / "original", tmp_path)
    original = read_bag(tmp_path / "original")
    commands = original.channels["/ldcs/external_wrench"]
    assert done.outcome.applied == len(commands) + 1 > 15
    assert commands.messages[0].header.frame_id == "twin1/P1_aligned"
    states, clouds = (original.channels[f"/ldcs/{name}"] for name in ("lattice_state", "nodes"))
    assert len(states) == len(clouds) and len(original.channels["/ldcs/solver_status"]) == 5
    assert states.messages[-1].position.dtype == np.float64

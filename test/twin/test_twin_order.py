"""The twin emits the right messages at exact times, in order, whoever calls it."""

from __future__ import annotations

import numpy as np
import pytest
from fake_scene import SPEED, RailScene

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

TRACKER = {"tracker": {"points": ["P0", "P1"], "rate": 80.0, "delay": 0.02, "noise": 1e-4, "seed": 3}}


def test_reports_come_at_exact_multiples_of_the_period(run):
    twin, collected = run(publish_rate=30.0)
    twin.advance_to(10.0)
    times = [message[3] for message in collected.on("nodes")]
    assert times == [round(k * 1e9 / 30) for k in range(301)]


def test_messages_come_in_the_order_of_time(run):
    twin, collected = run(RailScene(sensors=TRACKER), publish_rate=50.0)
    twin.advance_to(1.0)
    times = [message[3] for message in collected]
    assert times == sorted(times)


def test_calling_in_small_pieces_changes_nothing(run):
    whole, all_at_once = run(RailScene(sensors=TRACKER))
    whole.advance_to(0.5)
    pieces, bit_by_bit = run(RailScene(sensors=TRACKER))
    while pieces.next_time <= 0.5:
        pieces.advance_to_next()
    assert bit_by_bit == all_at_once


def test_a_late_delivery_does_not_stop_the_simulation_on_its_way(run):
    twin, _ = run(RailScene(sensors={"tracker": {**TRACKER["tracker"], "delay": 0.0137}}), publish_rate=20.0)
    while twin.next_time <= 0.2:
        twin.advance_to_next()
    ticks = {k / 80 for k in range(17)} | {k / 20 for k in range(5)} | {0.0}
    assert set(twin.simulation.visited) <= ticks


def test_the_tracker_pose_is_stamped_when_measured_and_delivered_later(run):
    twin, collected = run(RailScene(sensors=TRACKER))
    twin.advance_to(0.1)
    _topic, message_type, cdr, delivered = collected.on("P1/pose")[2]
    stamp = decode(message_type, cdr).header.stamp
    assert (stamp.sec, stamp.nanosec) == (0, 25_000_000)
    assert delivered == 45_000_000
    driver = decode("geometry_msgs/msg/TransformStamped", collected.on("trakstar_msg")[5][2])
    assert driver.header.stamp.nanosec == 45_000_000
    assert (driver.header.frame_id, driver.child_frame_id) == ("trakstar_base", "trakstar1")


def test_truth_has_no_noise_and_the_tracker_has(run):
    twin, collected = run(RailScene(sensors=TRACKER))
    twin.advance_to(0.1)
    heights = [decode(m[1], m[2]).pose.position.z for m in collected.on("truth/P0/pose")]
    assert np.allclose(heights, 0.02 + SPEED * np.arange(6) / 50, atol=1e-15)
    measured = np.array([decode(m[1], m[2]).pose.position.z for m in collected.on("P0/pose")])
    assert 1e-6 < np.abs(measured - 0.02 - SPEED * np.arange(len(measured)) / 80).max() < 1e-3


def test_a_scene_without_sensors_reports_none(run):
    twin, collected = run()
    twin.advance_to(0.2)
    names = {message[0] for message in collected}
    assert names == {"nodes", "truth/P0/pose", "truth/P1/pose", "joint_states", "/diagnostics"}


def test_the_pressure_sensor_reports_absolute_pressure(run):
    twin, collected = run(RailScene(sensors={"pressure": {"rate": 100.0}}))
    twin.simulation.inputs.set_pressure((1000.0, 2000.0))
    twin.advance_to(0.0)
    right = decode("sensor_msgs/msg/FluidPressure", collected.on("right/pressure")[0][2])
    assert right.fluid_pressure == 103325.0


def test_a_step_that_diverges_is_not_reported(run):
    twin, collected = run(RailScene(diverges_at=0.05))
    with pytest.raises(DivergenceError):
        twin.advance_to(1.0)
    assert [message[3] for message in collected.on("nodes")] == [0, 20_000_000, 40_000_000]
    twin.reset()
    collected.clear()
    twin.advance_to(0.02)
    assert [message[3] for message in collected.on("nodes")] == [0, 20_000_000]


def test_a_reset_repeats_the_noise(run):
    twin, collected = run(RailScene(sensors=TRACKER))
    twin.advance_to(0.3)
    first = list(collected)
    collected.clear()
    twin.reset()
    twin.advance_to(0.3)
    assert list(collected) == first


def test_another_seed_is_another_noise(run):
    poses = []
    for seed in (None, 3, 4):
        twin, collected = run(RailScene(sensors=TRACKER), seed=seed)
        twin.advance_to(0.1)
        poses.append([message[2] for message in collected.on("P0/pose")])
    assert poses[0] == poses[1] != poses[2]


def test_clock_and_tf_come_when_asked_for(run):
    twin, collected = run(publish_clock=True, publish_tf=True)
    twin.advance_to(0.02)
    assert [message[3] for message in collected.on("/clock")] == [0, 20_000_000]
    assert len(collected.on("/tf_static")) == 1
    moving = decode("tf2_msgs/msg/TFMessage", collected.on("/tf")[0][2]).transforms
    assert [one.child_frame_id for one in moving] == ["P0", "P1"]


def test_the_clock_ticks_with_the_fastest_stamp_and_frames_come_before_poses():
    log = []
    settings = RunSettings(publish_clock=True, publish_tf=True)
    twin = Twin(load_scene("rig"), settings, sinks=[lambda topic, kind, cdr, time: log.append((topic, time))])
    twin.advance_to(0.2)
    clock = [time for topic, time in log if topic == "/clock"]
    assert clock == [10_000_000 * k for k in range(21)], "the pressure gauges measure at 100 Hz"
    for time in {time for topic, time in log if topic == "/tf"}:
        topics = [topic for topic, at in log if at == time]
        assert topics[0] == "/clock"
        poses = [topics.index(topic) for topic in topics if topic.endswith("/pose")]
        assert topics.index("/tf") < min(poses)
    topics = [topic for topic, _ in log]
    assert topics.index("/tf_static") < topics.index("/tf") and topics.count("/tf_static") == 1


def test_the_clock_changes_no_state():
    import numpy as np

    states = []
    for publish_clock in (False, True):
        twin = Twin(load_scene("rig"), RunSettings(publish_clock=publish_clock))
        twin.advance_to(0.1)
        states.append(twin.simulation.state.position)
    assert np.array_equal(*states)

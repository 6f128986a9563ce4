"""Reports hold the state, the sensors' values and nothing that no subscriber asked for; commands are counted."""

from __future__ import annotations

import numpy as np
import pytest
from fake_scene import RailScene
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.watchdog import Watchdog

SENSORS = {"pressure": {"rate": 50.0, "noise": 30.0}}


def last(collected, topic):
    _, kind, cdr, _ = collected.on(topic)[-1]
    return decode(kind, cdr)


def test_a_pressure_is_absolute_and_its_variance_the_square_of_the_noise(run):
    twin, collected = run(RailScene(sensors=SENSORS), ambient_pressure=95_000.0, seed=1)
    twin.advance_to(0.1)
    message = last(collected, "left/pressure")
    assert message.variance == pytest.approx(900.0)
    assert message.fluid_pressure == pytest.approx(95_000.0, abs=6 * 30.0)
    exact, exact_collected = run(RailScene(sensors={"pressure": {"rate": 50.0, "noise": 0.0}}))
    exact.advance_to(0.1)
    message = last(exact_collected, "right/pressure")
    assert message.variance == 0.0 and message.fluid_pressure == pytest.approx(101_325.0)


def test_joints_are_the_angles_rates_and_torques_of_the_simulation(run):
    twin, collected = run()
    twin.advance_to(0.1)
    message, simulation = last(collected, "joint_states"), twin.simulation
    assert tuple(message.name) == simulation.joint_names
    np.testing.assert_allclose(message.effort, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(message.position, simulation.state.joint_angle.ravel())
    np.testing.assert_allclose(message.velocity, simulation.state.joint_rate.ravel())


SMALL = {
    "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [2, 2], "mass": 0.1},
    "points": {"P1": ["mid", "free_edge"]},
    "effects": [{"type": "springs"}, {"type": "clamp"}],
}


@pytest.mark.parametrize("asked", ["surface", "traces"])
def test_a_marker_topic_is_reported_for_its_subscribers_alone(run, asked):
    twin, collected = run(load_scene(SMALL), has_subscribers=lambda topic: topic == asked)
    twin.advance_to(0.1)
    topics = {topic for topic, *_ in collected}
    assert topics & {"surface", "arms", "loads", "traces"} == {asked}
    assert len(collected.on(asked)) == 6  # at 0, 20, ..., 100 ms


def test_settings_without_values_are_the_documented_ones_and_return_from_a_bags_metadata():
    settings = RunSettings()
    assert settings.to_metadata() == {
        "seed": "",
        "accuracy": "",
        "publish_rate": "50.0",
        "tracker_rate": "",
        "ambient_pressure": "101325.0",
        "publish_clock": "false",
        "publish_tf": "false",
        "link_frames": "true",
        "frame_prefix": "",
        "detail": "false",
        "settled": "false",
        "command_steps": "true",
        "known_commands": "schedule",
        "verify": "false",
    }
    chosen = RunSettings(seed=3, accuracy=1e-6, publish_rate=20.0, full_precision=True, frame_prefix="twin/")
    assert chosen.to_metadata()["detail"] == "true"
    assert RunSettings.from_metadata(chosen.to_metadata()) == chosen
    assert RunSettings.from_metadata({}) == settings
    # A bag from before the links had frames replays without them, one from before command steps by other steps.
    old = RunSettings.from_metadata({"publish_tf": "true"})
    assert not old.link_frames and not old.command_steps and old.known_commands == "held"


def test_a_watchdog_counts_its_trips_from_zero():
    time = [0.0]
    watchdog = Watchdog(lambda: time[0], timeout=0.5)
    assert watchdog.trips == 0 and (Watchdog(lambda: 0.0).timeout, Watchdog(lambda: 0.0).wrench_timeout) == (
        0,
        0,
    )
    assert Watchdog(lambda: 0.0).state == "off" and watchdog.state == "idle"


def test_each_accepted_command_counts_once_and_a_refused_one_elsewhere(run):
    twin, _ = run()
    for _ in range(3):
        assert twin.receive("pressure_command", pressure_command([1e5])) is None
    assert "above" in twin.receive("pressure_command", pressure_command([9e5]))
    assert twin.commands.accepted == {"pressure_command": 3}
    assert sum(twin.commands.refused.values()) == 1 and "above" in twin.commands.last_refusal


def test_one_pressure_is_for_both_arms_and_two_are_one_each(run):
    arms = {"type": "arms", "links": 2, "width": 0, "drive": "pressure", "dead_time": 0.0, "fill_time": 0.0}
    twin, _ = run(load_scene({**SMALL, "effects": [*SMALL["effects"], arms]}))
    assert twin.receive("pressure_command", pressure_command([40e3])) is None
    twin.advance_to(0.02)
    np.testing.assert_allclose(twin.simulation.inputs.pressure, [40e3, 40e3])
    assert twin.receive("pressure_command", pressure_command([10e3, 20e3])) is None
    twin.advance_to(0.04)
    np.testing.assert_allclose(twin.simulation.inputs.pressure, [10e3, 20e3])


def test_the_tracker_stands_unturned_in_the_base_frame(run):
    twin, collected = run(publish_tf=True)
    twin.advance_to(0.02)
    (base,) = last(collected, "/tf_static").transforms
    turn, place = base.transform.rotation, base.transform.translation
    assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)
    assert (place.x, place.y, place.z) == (0.0, 0.0, 0.0)
    assert (base.header.frame_id, base.child_frame_id) == ("ldcs_base", "trakstar_base")


@pytest.mark.parametrize("holes", [[], [{"circle": [0.05, 0.0, 0.012]}]])
def test_a_cloud_is_dense_without_holes_only(run, holes):
    lattice = {"size": [0.1, 0.1, 0.01], "nodes": [5, 5], "mass": 0.1, "holes": holes}
    twin, collected = run(load_scene({**SMALL, "lattice": lattice}))
    twin.advance_to(0.02)
    message = last(collected, "nodes")
    assert message.is_dense is (not holes) and (message.height, message.width) == (10, 5)


def test_diagnostics_come_once_a_second_and_joints_with_arms_alone(run):
    twin, collected = run()
    twin.advance_to(2.5)
    assert [time for *_, time in collected.on("/diagnostics")] == [0, 10**9, 2 * 10**9]
    bare, bare_collected = run(load_scene(SMALL))
    bare.advance_to(0.1)
    assert not bare_collected.on("joint_states") and "joint_states" not in bare.topics


@pytest.mark.parametrize("with_arms", [True, False])
def test_the_robot_of_the_arms_is_described_where_there_are_arms(run, with_arms):
    arms = [{"type": "arms", "links": 2, "width": 0}] if with_arms else []
    twin, collected = run(load_scene({**SMALL, "effects": [*SMALL["effects"], *arms]}), publish_tf=True)
    twin.advance_to(0.02)
    assert len(collected.on("robot_description")) == (1 if with_arms else 0)


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("seed", str(2**64 - 1), str(2**64)),
        ("seed", "0", str(2**64 + 1)),
        ("accuracy", "1e-12", "0.0"),
        ("ambient_pressure", "0.5", "-1.0"),
    ],
)
def test_settings_of_a_bag_have_bounds(name, good, bad):
    assert float(getattr(RunSettings.from_metadata({name: good}), name)) == float(good)
    with pytest.raises(ValueError, match="got"):
        RunSettings.from_metadata({name: bad})


@pytest.mark.parametrize("link_frames", [True, False])
def test_links_have_frames_where_they_are_asked_for(run, link_frames):
    twin, collected = run(load_scene(small_sheet(nodes=(3, 3))), publish_tf=True, link_frames=link_frames)
    twin.advance_to(0.0)
    frames = [one.child_frame_id for one in last(collected, "/tf").transforms]
    assert frames[:2] == ["P0", "P1"] and (len(frames) > 2) == link_frames


@pytest.mark.parametrize(("asked", "of_the_scene"), [(True, False), (False, True), (False, False)])
def test_a_run_is_verified_where_its_settings_or_its_scene_ask(run, asked, of_the_scene):
    scene = load_scene({**SMALL, "solver": {"accuracy": 1e-4, "verify": of_the_scene}})
    twin, _ = run(scene, verify=asked)
    assert twin.settings.verify == (asked or of_the_scene)

"""A bag that this project did not write: names, units and clocks by a mapping, holes and copies counted."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import rig_bag
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rig_bag import WALL, array, fluid, transform, wrench, write

from ldcs_ros import load_scene
from ldcs_ros.bags import BagWriter, read_bag
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.replay.session import Changes, replay
from ldcs_ros.replay.session import replay as run_replay
from ldcs_ros.signals import MappingError
from ldcs_ros.signals.mapping import parse_mapping
from ldcs_ros.twin.twin import Twin

MS = 1_000_000


def mapping(*commands, **more):
    return parse_mapping({"commands": list(commands), "initial": "start", **more})


def fed(folder):
    """Return the commands in a bag as (time [s], pressures [Pa])."""
    channel = read_bag(folder).channels["/ldcs/pressure_command"]
    return [(message.time / 1e9, decode(message.type, message.cdr).data.tolist()) for message in channel.raw]


def run(source, tmp_path, scene, mapped):
    return run_replay(source, tmp_path / "twin", changes=Changes(scene=scene), mapping=mapped)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_names_units_and_order_of_arms_come_from_the_mapping(tmp_path, pneumatic, storage):
    messages = [
        ("/other", WALL, array([0.0])),
        ("/valves", WALL + 100 * MS, array([500.0, 300.0])),
        ("/valves", WALL + 250 * MS, array([0.0, 900.0])),
        ("/other", WALL + 400 * MS, array([0.0])),
    ]
    source = write(tmp_path / "rig", messages, storage=storage)
    command = {"topic": "/valves", "to": "pressure_command", "unit": "mbar", "arms": ["right", "left"]}
    done = run(source, tmp_path, pneumatic, mapping(command))
    assert fed(tmp_path / "twin") == [(0.1, [3e4, 5e4]), (0.25, [9e4, 0.0])]
    assert done.outcome.applied == 2 and done.twin.time == 0.4
    assert read_bag(tmp_path / "twin").custom_data["log_time_of_start"] == str(WALL)


def test_without_names_the_values_of_a_topic_are_those_of_the_scenes_arms(tmp_path, pneumatic):
    content = pneumatic.content
    content["effects"][3]["arms"] = [
        {"name": name, "from": [0.0, y], "to": [0.07, y]}
        for name, y in (("a", 0.07), ("b", 0.0), ("c", -0.07))
    ]
    content["inputs"] = []
    scene = load_scene(content)
    messages = [
        ("/valves", WALL, array([100.0, 200.0, 300.0])),
        ("/one", WALL + 50 * MS, array([9e4])),
        ("/valves", WALL + 100 * MS, array([100.0, 200.0])),
    ]
    source = write(tmp_path / "rig", messages)
    valves = {"topic": "/valves", "to": "pressure_command", "unit": "mbar"}
    done = run(
        source, tmp_path, scene, mapping(valves, {"topic": "/one", "to": "pressure_command", "arms": ["b"]})
    )
    assert fed(tmp_path / "twin") == [(0.0, [1e4, 2e4, 3e4]), (0.05, [1e4, 9e4, 3e4])]
    assert [report.problem for report in done.reports if report.problem] == [
        "got 2 pressures, expected 1 or 3 for ('a', 'b', 'c')"
    ]


def test_the_twin_goes_as_if_somebody_had_commanded_it(tmp_path, pneumatic):
    source = write(tmp_path / "rig", [("/p", WALL, array([0.0])), ("/p", WALL + 130 * MS, array([6e4]))])
    done = run(source, tmp_path, pneumatic, mapping({"topic": "/p", "to": "pressure_command"}))
    twin = Twin(pneumatic.without_schedule())
    twin.advance_to(0.13)
    twin.receive("pressure_command", pressure_command([6e4, 6e4]))
    twin.advance_to(0.13)
    assert np.array_equal(done.twin.simulation.state.position, twin.simulation.state.position)
    assert done.outcome.unchanged == 1


def test_a_bag_made_from_a_rigs_bag_is_our_own(tmp_path, pneumatic):
    source = write(
        tmp_path / "rig", [("/p", WALL + k * 33 * MS, array([1e4 * k])) for k in range(8)], storage="sqlite3"
    )
    command = {"topic": "/p", "to": "pressure_command"}
    mapped = parse_mapping({"commands": [command], "initial": "rest"})
    assert run(source, tmp_path, pneumatic, mapped).twin.settings.settled
    assert replay(tmp_path / "twin", tmp_path / "again").verdict.same_bytes


def test_a_smooth_course_of_a_rig_is_known_beforehand_and_its_bag_replays_to_the_bit(tmp_path, pneumatic):
    course = 4e4 * (1.0 - np.cos(4.0 * np.arange(60) * 0.01))
    source = write(tmp_path / "rig", [("/p", WALL + k * 10 * MS, array([p])) for k, p in enumerate(course)])
    mapped = parse_mapping({"commands": [{"topic": "/p", "to": "pressure_command"}], "initial": "rest"})
    done = run(source, tmp_path, pneumatic, mapped)
    assert done.twin.settings.known_commands == "all" and done.outcome.applied == 59
    assert done.twin.simulation.statistics.steps < 59
    again = replay(tmp_path / "twin", tmp_path / "again")
    assert again.verdict.same_bytes and again.twin.simulation.statistics.steps < 59


def test_absolute_pressures_of_single_arms_become_gauge_pressures(tmp_path, pneumatic):
    psi = 6894.757293168361
    messages = [
        ("/l", WALL, fluid(WALL, 14.6)),  # the ambient pressure of the day, a little below the standard
        ("/r", WALL + 10 * MS, fluid(WALL, 101325.0 + 5e4)),
        ("/l", WALL + 20 * MS, fluid(WALL + MS, 101325.0 / psi + 2.0)),
    ]
    done = run(
        write(tmp_path / "rig", messages),
        tmp_path,
        pneumatic,
        mapping(
            {"topic": "/l", "to": "pressure_command", "arms": ["left"], "unit": "psi"},
            {"topic": "/r", "to": "pressure_command", "arms": ["right"]},
        ),
    )
    assert [time for time, _ in fed(tmp_path / "twin")] == [0.01, 0.02]
    assert np.allclose([p for _, p in fed(tmp_path / "twin")], [[0.0, 5e4], [2.0 * psi, 5e4]])
    assert done.reports[0].below_zero == 1 and not done.outcome.refused


def test_copies_late_and_disordered_messages_and_holes_are_counted(tmp_path, pneumatic):
    sent = [(k, WALL + k * 20 * MS) for k in range(30) if not 12 <= k < 18]
    messages = [("/l", stamp + 5 * MS, fluid(stamp, 101325.0 + 1e3 * k)) for k, stamp in sent]
    messages.insert(4, messages[3])  # a copy, recorded at the same time
    messages.insert(9, ("/l", messages[8][1] + 8 * MS, messages[8][2]))  # a copy, recorded later
    topic, log, late = messages[15]
    messages[15] = (topic, log + 300 * MS, late)
    messages.sort(key=lambda message: message[1])
    source = write(tmp_path / "rig", messages)
    command = {"topic": "/l", "to": "pressure_command", "arms": ["left"]}
    done = run(source, tmp_path, pneumatic, mapping(command, time="stamp"))
    report = done.reports[0]
    assert (report.messages, report.repeated, report.late, report.out_of_order) == (26, 2, 1, 1)
    assert report.missing == 6 and report.longest_gap == pytest.approx(0.14)
    pressures = [pressure[0] for _, pressure in fed(tmp_path / "twin")]
    assert pressures == sorted(pressures) and len(pressures) == 23, (
        "by stamp; zero at the start changes nothing"
    )
    assert any("missing" in remark for remark in report.warnings())


def test_stamps_of_another_clock_are_brought_to_the_recorders(tmp_path, pneumatic):
    boot = 5_000_000_000  # a driver that counts from its start
    messages = [
        ("/l", WALL + k * 50 * MS + (k % 3) * MS, fluid(boot + k * 50 * MS, 111325.0 + k)) for k in range(8)
    ]
    command = {"topic": "/l", "to": "pressure_command", "arms": ["left"]}
    done = run(write(tmp_path / "rig", messages), tmp_path, pneumatic, mapping(command, time="stamp"))
    assert done.reports[0].clock_offset == pytest.approx((boot - WALL) * 1e-9)
    assert [time for time, _ in fed(tmp_path / "twin")] == pytest.approx([0.05 * k for k in range(8)])


def test_commands_that_are_not_sound_are_refused_and_counted(tmp_path, pneumatic):
    values = [[1e4], [float("nan")], [9e9], [-5e4], [1.0, 2.0, 3.0], [2e4]]
    messages = [("/p", WALL + k * 20 * MS, array(value)) for k, value in enumerate(values)]
    messages.append(("/p", WALL + 130 * MS, ("std_msgs/msg/Float64MultiArray", b"\x00\x01\x00\x00\xff")))
    source = write(tmp_path / "rig", messages)
    done = run(source, tmp_path, pneumatic, mapping({"topic": "/p", "to": "pressure_command"}))
    assert dict(done.reports[0].refused) == {"not a number": 1, "over limit": 2}
    assert done.reports[0].malformed == 2 and done.outcome.applied == 2
    assert fed(tmp_path / "twin")[-1] == (0.1, [2e4, 2e4])


def test_wrenches_and_any_field_of_any_message(tmp_path, motorised):
    vector = rig_bag.build("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=100.0)
    stamped = rig_bag.build("geometry_msgs/msg/Vector3Stamped", header=rig_bag.header(WALL), vector=vector)
    messages = [
        ("/force", WALL, stamped),
        ("/push", WALL + 20 * MS, wrench(WALL, "P1", (0.1, 0.0, 0.0))),
        ("/push", WALL + 40 * MS, wrench(WALL + MS, "P1", (0.1, 0.0, 0.0))),
        ("/motors", WALL + 60 * MS, array(np.full(8, 30.0))),
    ]
    done = run(
        write(tmp_path / "rig", messages),
        tmp_path,
        motorised,
        mapping(
            {"topic": "/force", "to": "external_wrench", "frame": "P0_aligned", "unit": "mN"},
            {"topic": "/push", "to": "external_wrench"},
            {"topic": "/motors", "to": "torque_command", "unit": "mN m", "field": "data"},
        ),
    )
    inputs = done.twin.simulation.inputs
    assert inputs.wrenches["P0_aligned"].force == pytest.approx((0.0, 0.0, 0.1))
    assert inputs.wrenches["P1"].force == (0.1, 0.0, 0.0)
    assert np.allclose(inputs.torque, 0.03)
    assert (done.outcome.applied, done.outcome.unchanged) == (3, 1)


def test_a_bag_under_our_names_needs_no_mapping(tmp_path, pneumatic):
    messages = [("/rig7/pressure_command", WALL + k * 40 * MS, array([1e4 * k, 0.0])) for k in range(4)]
    messages.append(("/rig7/trakstar_msg", WALL + 200 * MS, transform(WALL, "trakstar0", (0, 0, 0))))
    source = write(tmp_path / "rig", messages, storage="sqlite3")
    done = replay(source, tmp_path / "twin", changes=Changes(scene=pneumatic))
    assert done.outcome.applied == 3 and done.twin.time == done.start + 0.2


def test_a_mapping_that_does_not_fit_is_refused_before_anything_is_written(tmp_path, pneumatic):
    source = write(tmp_path / "rig", [("/valves", WALL, array([1.0]))])
    with pytest.raises(MappingError, match=r"no topic '/valve', only \['/valves'\]"):
        run(source, tmp_path, pneumatic, mapping({"topic": "/valve", "to": "pressure_command"}))
    with pytest.raises(
        MappingError, match=r"expected arms of the scene \['left', 'right'\] @ commands\[0\].arms"
    ):
        middle = {"topic": "/valves", "to": "pressure_command", "arms": ["middle"]}
        run(source, tmp_path, pneumatic, mapping(middle))
    with pytest.raises(MappingError, match="name one in a mapping file"):
        replay(source, tmp_path / "twin", changes=Changes(scene=pneumatic))
    with pytest.raises(ValueError, match="--scene rig"):
        replay(source, tmp_path / "twin")
    assert not (tmp_path / "twin").exists()


def test_the_bag_of_a_rig_beside_a_twin_brings_its_scene_and_gets_no_verdict(tmp_path, pneumatic):
    said = {"scene": pneumatic.text, "rig": "title: a valve island\n"}
    with BagWriter(tmp_path / "rig", topics={}, custom_data=said) as writer:
        for k in range(5):
            command = pressure_command([1e4 * k, 0.0])
            writer.write("/ldcs/pressure_command", "std_msgs/msg/Float64MultiArray", command, k * 50 * MS)
    done = replay(tmp_path / "rig", tmp_path / "twin")
    assert done.verdict is None and done.twin.settings.settled and done.outcome.applied == 4
    assert not done.twin.scene.inputs


TYPES = (
    "std_msgs/msg/Float64MultiArray",
    "sensor_msgs/msg/FluidPressure",
    "std_msgs/msg/Float64",
    "std_msgs/msg/String",
    "geometry_msgs/msg/WrenchStamped",
)
NUMBER = st.one_of(st.floats(), st.floats(-1e5, 2e5)).map(
    lambda value: b"\x00\x01\x00\x00" + struct.pack("<d", value)
)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(TYPES),
    cdrs=st.lists(st.one_of(st.binary(max_size=80), NUMBER), min_size=1, max_size=12),
    to=st.sampled_from(["pressure_command", "external_wrench"]),
    time=st.sampled_from(["log", "stamp"]),
)
def test_no_bytes_break_a_replay(tmp_path_factory, pneumatic, kind, cdrs, to, time):
    folder = tmp_path_factory.mktemp("bytes")
    source = write(folder / "rig", [("/x", WALL + k * 10 * MS, (kind, cdr)) for k, cdr in enumerate(cdrs)])
    done = run(source, folder, pneumatic, mapping({"topic": "/x", "to": to}, time=time))
    outcome, report = done.outcome, done.reports[0]
    assert report.messages == len(cdrs) and np.isfinite(done.twin.simulation.state.position).all()
    dealt_with = outcome.applied + outcome.unchanged + sum(outcome.refused.values()) + outcome.not_reached
    # A message that is found to be malformed when its turn comes counts as one that changed nothing, too.
    assert dealt_with >= len(cdrs) - report.malformed

"""Tables (CSV, Parquet) as recordings: units, frames and arms by a mapping, by words, or by the names of columns."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.errors import MappingError, RecordingError
from ldcs_ros.replay.external_bag import mapped_commands
from ldcs_ros.replay.session import replay
from ldcs_ros.signals import load_mapping
from ldcs_ros.signals.run import run_of
from ldcs_ros.signals.signals import read_signals
from ldcs_ros.signals.tables import columns_mapping, open_recording

LAB = """\
# exported by the laboratory's logger
Zeit;p1;p2;x;y;z;p1_abs;Bemerkung
1000,0;0;0;10;20;30;1013,25;Start
1010,0;12,5;0;10;20;30;;
1020,0;12,5;25;11,5;20;;1113,25;
;1;1;1;1;1;1;ohne Zeit
1015,0;12,5;0;10,5;20;31;1063,25;zu spaet
"""
MAPPING = """\
time: {column: Zeit, unit: ms}
commands:
  - {columns: [p2, p1], to: pressure_command, unit: kPa, arms: [right, left]}
measurements:
  - {columns: [x, y, z], to: P1, unit: mm, translation: [0.1, 0, 0], rotation: [0, 1, 0, 0]}
  - {columns: [p1_abs], to: left/pressure, unit: mbar, absolute: true}
"""


@pytest.fixture
def lab(tmp_path):
    path = tmp_path / "lab.csv"
    path.write_text(LAB)
    (tmp_path / "lab.yaml").write_text(MAPPING)
    return path


def test_a_laboratorys_csv_becomes_si_in_the_frame_of_the_base(lab):
    recording, mapping = open_recording(lab, load_mapping(lab.with_suffix(".yaml")))
    found = read_signals(recording, name="lab", mapping=mapping, measured=True).series
    # Half a turn about y: x and z change sign.
    np.testing.assert_allclose(
        found["P1"].value, [[0.09, 0.02, -0.03], [0.09, 0.02, -0.03], [0.0895, 0.02, -0.031]], atol=1e-12
    )
    np.testing.assert_allclose(found["P1"].time, [0.0, 0.010, 0.015], atol=1e-12)
    np.testing.assert_allclose(found["left/pressure"].value[:, 0], [0.0, 5000.0, 10000.0], atol=1e-6)
    assert recording.notes == (
        "1 rows without a time are left out",
        "1 rows before the time of the row above are sorted",
    )
    assert recording.duration == pytest.approx(0.020)


def test_one_measured_coordinate_is_read_alone_and_written_again(tmp_path):
    # A laser 0.4 m above the base looks down; a logger counts seconds since 1970.
    table, topics = tmp_path / "laser.tsv", tmp_path / "laser.yaml"
    table.write_text("epoch\tp\td\n1732712400,25\t0\t390,5\n1732712400,50\t10\t\n1732712400,75\t10\t380\n")
    topics.write_text("""\
time: {column: epoch}
commands: [{columns: [p], to: pressure_command, unit: kPa}]
measurements: [{columns: [d], to: P1.z, unit: mm, translation: [0, 0, 0.4], rotation: [1, 0, 0, 0]}]
""")
    recording, mapping = open_recording(table, load_mapping(topics))
    signals = read_signals(recording, name="laser", mapping=mapping, measured=True)
    found = signals.series["P1.z"]
    np.testing.assert_allclose(found.value, [[0.0095], [0.02]], atol=1e-12)
    np.testing.assert_allclose(found.time, [0.0, 0.5], atol=1e-6)
    assert signals.channel("P1.z") is found and signals.channel("P1.x") is None
    run = run_of(recording, mapping)
    assert "P1.z [m]" in run.columns and "P1.x [m]" not in run.columns
    run.plot()
    run.write(tmp_path / "again.csv")
    again = run_of(*open_recording(tmp_path / "again.csv", None))
    np.testing.assert_array_equal(again.channels["P1"], run.channels["P1"])


def test_its_commands_reach_the_arms_that_the_mapping_names(lab):
    recording, mapping = open_recording(lab, load_mapping(lab.with_suffix(".yaml")))
    simulation = load_scene("rig").without_schedule().build()
    given = []
    for timed in mapped_commands(recording, mapping)[0]:
        command = timed.command(simulation)
        if command is not None:
            pressure = np.frombuffer(command[1][-16:], dtype="<f8")
            simulation.inputs.set_pressure(pressure)
            given.append((timed.time * 1e-9, *pressure))
    # In the scene's order of the arms: left, right.
    np.testing.assert_allclose(given, [[0.010, 12500.0, 0.0], [0.020, 12500.0, 25000.0]])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings_of_spreadsheets_are_read(tmp_path, encoding):
    path = tmp_path / "table.csv"
    path.write_bytes("Zeit [µs]\tDrück\n0\t1,5\n10\t2,5\n".encode(encoding))
    recording, _ = open_recording(path, columns_mapping(["time=Zeit [µs]:us", "pressure_command=Drück:bar"]))
    assert recording.duration == pytest.approx(1e-5)
    assert [message.data for message in recording.channels["Drück"].messages] == [1.5, 2.5]


def test_words_say_the_same_as_a_mapping_file():
    mapping = columns_mapping(
        [
            "time=t:ms",
            "pressure_command.left=p:kPa",
            "P1=x,y,z:mm",
            "joint/left_joint_1=a:deg",
            "initial=start",
        ]
    )
    assert mapping.time_column is not None and mapping.time_column.scale == 1e-3
    assert mapping.initial == "start"
    assert mapping.commands[0].arms == ("left",) and mapping.commands[0].scale == 1e3
    assert mapping.measurements[0].columns == ("x", "y", "z")
    assert mapping.measurements[1].scale == pytest.approx(np.pi / 180.0)


def test_dates_are_times(tmp_path):
    path = tmp_path / "dated.csv"
    path.write_text("when,p\n2024-05-01 10:00:00.25,1\n2024-05-01T10:00:01.5Z,2\n")
    german = tmp_path / "german.txt"
    german.write_text("when;p\n01.05.2024 10:00:00,25;1\n1.5.2024 10:00:01,500;2\n")
    for table in (path, german):
        recording, _ = open_recording(table, columns_mapping(["time=when", "pressure_command=p:bar"]))
        assert recording.start == 1714557600_250_000_000
        assert recording.duration == 1.25


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_exported_run_replays_to_the_same_places(tmp_path, suffix):
    scene = load_scene("rig").without_schedule()
    simulation = scene.build()
    simulation.inputs.set_pressure([30e3, 50e3])
    run = simulation.run(0.2, every=0.02)
    path = tmp_path / f"run{suffix}"
    run.write(path)
    recording, mapping = open_recording(path, None)
    again = run_of(recording, mapping)
    for name, values in run.channels.items():
        np.testing.assert_allclose(
            again.channels[name], values, rtol=0, atol=1e-12 * max(1.0, np.abs(values).max())
        )
    np.testing.assert_array_equal(again.time, run.time)

    from dataclasses import replace

    from ldcs_ros.replay.session import Changes

    done = replay(path, tmp_path / "bag", changes=Changes(scene), mapping=replace(mapping, initial="start"))
    assert done.outcome.applied >= 1
    np.testing.assert_allclose(done.twin.simulation.pose("P1")[0], run.channels["P1"][-1], atol=1e-5)


def test_a_twins_bag_keeps_its_schedule_as_commands():
    run = run_of(read_bag("bags/paper"), None)
    assert run.nodes.shape == (len(run.node_time), 2, *load_scene("paper").lattice.nodes, 3)
    chirp = run_of(read_bag("bags/chirp"), None)
    commands = chirp.channels["pressure_command.left"]
    assert np.isfinite(commands).all() and np.ptp(commands) > 10e3


@pytest.mark.parametrize(
    ("text", "words", "expected"),
    [
        ("t,p\n0,1\n", ["time=t", "pressure_command=q"], "has no column 'q', only ['t', 'p']"),
        (
            "t,p\n0,1\n1,zwei\n",
            ["time=t", "pressure_command=p"],
            "line 3, column 'p': got 'zwei', expected a number",
        ),
        ("t;p\ns;mbar\n0;1\n", ["time=t", "pressure_command=p"], "lines that begin with # are left out"),
        ("t;p\n13:00:00;1\n", ["time=t", "pressure_command=p"], "or 01.05.2024 10:00:00,25"),
        ("t,p,p\n0,1,2\n", ["time=t", "pressure_command=p"], "2 columns 'p', expected one"),
        (
            "t,p\n0,1,2\n",
            ["time=t", "pressure_command=p"],
            "got 3 cells, expected 2: one for each column name of line 1",
        ),
        ("t,p\n0,\n", ["time=t", "pressure_command=p"], "no row with a number in each"),
        ("", ["time=t", "pressure_command=p"], "is empty"),
        ("t,p\n0,\x001\n", ["time=t", "pressure_command=p"], "is no CSV: it contains NUL"),
        ("t,p\n0,inf\n", ["time=t", "pressure_command=p"], "no row with a number"),
        ('t,p\n0,"1\n', ["time=t", "pressure_command=p"], "is no CSV"),
        ("t,p\n1e30,1\n", ["time=t", "pressure_command=p"], "expected times below 285 years"),
        ("t,p\n0,1\n", None, "say what they mean, for example --columns time=t:ms"),
    ],
)
def test_what_is_wrong_with_a_table_is_said_in_one_line(tmp_path, text, words, expected):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises((RecordingError, MappingError)) as caught:
        open_recording(path, None if words is None else columns_mapping(words))
    assert expected in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["pressure_command=p"], "no column of times"),
        (["time=t", "P1=x,y"], "a point has the columns of x, y and z, one coordinate of it is P1.z=COLUMN"),
        (["time=t", "pressurecommand=p"], "Did you mean 'pressure_command'"),
        (["time=t", "P1=x,y,z:inches"], "inch"),
        (["time=t", "P1"], "expected NAME=COLUMN,...:UNIT"),
        (["time=t", "external_wrench=x,y,z"], "got no frame"),
        (["time=t", "P1.q=z:mm"], "expected a point such as P0, a coordinate such as P1.z"),
        (["time=t", "P1=x,y,z", "P1.z=h"], "got P1.z twice"),
        (["time=t", "P1.z=x,y,z"], "got 3 columns, expected 1"),
        (["time=t"], "nothing is mapped"),
    ],
)
def test_wrong_words_are_refused_with_their_place(words, expected):
    with pytest.raises(MappingError, match=expected):
        columns_mapping(words)


def test_a_bag_and_the_mapping_of_a_table_do_not_go_together():
    with pytest.raises(MappingError, match="the mapping is for a table"):
        open_recording("bags/paper", columns_mapping(["time=t", "pressure_command=p"]))


def test_three_coordinates_of_a_point_are_one_channel_and_two_are_two(tmp_path):
    whole = tmp_path / "whole.csv"
    whole.write_text("time,P1.x,P1.y,P1.z\n0,1,2,3\n1,4,5,6\n")
    recording, mapping = open_recording(whole, None)
    found = read_signals(recording, name="whole", mapping=mapping, measured=True).series
    assert set(found) == {"P1"}
    np.testing.assert_allclose(found["P1"].value, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    part = tmp_path / "part.csv"
    part.write_text("time,P1.x,P1.z\n0,1,3\n1,4,6\n")
    recording, mapping = open_recording(part, None)
    found = read_signals(recording, name="part", mapping=mapping, measured=True).series
    assert set(found) == {"P1.x", "P1.z"}

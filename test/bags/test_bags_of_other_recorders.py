"""Bags of other recorders are read completely, or refused in one line that says why."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import zstandard
from other_recorders import OPTIONS, STEP, WALL, card, pressure, write_mcap, write_sqlite3

from ldcs_ros.bags import read_bag, recover
from ldcs_ros.errors import RecordingError

TIMES = [WALL + k * STEP for k in range(6)]


def values(recording):
    return [round(message.fluid_pressure - 101325.0) for message in recording.channels["/v"].messages]


def one_line(call, *arguments):
    with pytest.raises(RecordingError) as caught:
        call(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("option", OPTIONS)
def test_an_mcap_file_of_any_option_is_read_completely(tmp_path, option):
    file = write_mcap(tmp_path / "rig.mcap", **OPTIONS[option])
    recording = read_bag(file)
    assert (recording.counts, recording.start, recording.end) == ({"/v": 6}, TIMES[0], TIMES[-1])
    assert recording.channels["/v"].times.tolist() == TIMES
    assert values(recording) == [1000, 2000] * 3
    assert recover(file).untouched


@pytest.mark.parametrize("option", ["zstd", "no_chunks", "no_index", "no_summary", "small_chunks"])
def test_messages_come_by_log_time_however_they_were_written(tmp_path, option):
    times = [30, 10, 20, 10, 0, 25]
    options = {**OPTIONS[option], "chunk_size": 100}
    recording = read_bag(write_mcap(tmp_path / "rig.mcap", times, **options))
    assert recording.channels["/v"].times.tolist() == sorted(times)
    first, second = (message.cdr for message in recording.channels["/v"].raw if message.time == 10)
    assert (first, second) == (pressure(TIMES[1], 103325.0), pressure(TIMES[3], 103325.0))
    assert (recording.start, recording.end) == (0, 30)


@pytest.mark.parametrize("encoding", ["json", "protobuf"])
def test_channels_that_are_no_ros_messages_are_left_out_with_a_note(tmp_path, encoding):
    recording = read_bag(write_mcap(tmp_path / "rig.mcap", beside=encoding))
    assert recording.counts == {"/v": 6} and values(recording) == [1000, 2000] * 3
    assert recording.notes == (f"left out, since they hold no ROS 2 messages: /log ({encoding})",)


def test_a_bag_without_a_ros_message_is_refused_and_recover_is_no_advice(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", encoding="cbor", beside="json")
    for call in (read_bag, recover):
        assert "holds no ROS 2 messages" in one_line(call, file)
    assert "recover" not in one_line(read_bag, file)


@pytest.mark.parametrize("profile", ["", "x-rig"])
def test_the_channels_say_what_a_file_holds_not_its_profile(tmp_path, profile):
    file = write_mcap(tmp_path / "rig.mcap", profile=profile)
    assert values(read_bag(file)) == [1000, 2000] * 3
    assert recover(file).untouched


@pytest.mark.parametrize("option", ["zstd", "no_chunks", "no_statistics"])
def test_log_times_after_2262_are_refused(tmp_path, option):
    file = write_mcap(tmp_path / "rig.mcap", [WALL, 2**64 - 1], **OPTIONS[option])
    for call in (read_bag, recover):
        assert "18446744073709551615 ns, after the year 2262" in one_line(call, file)


def test_the_wal_file_of_sqlite3_belongs_to_the_bag_and_reading_changes_neither(tmp_path):
    file = write_sqlite3(tmp_path / "rig.db3", [101325.0, 151325.0] * 4, in_wal=4)
    before = {name: (tmp_path / name).read_bytes() for name in ("rig.db3", "rig.db3-wal")}
    recording = read_bag(file)
    assert recording.channels["/v"].times.tolist() == [WALL + k * STEP for k in range(8)]
    assert values(recording) == [0, 50000] * 4
    assert {name: (tmp_path / name).read_bytes() for name in before} == before


READER = """
import os, sys
from ldcs_ros.bags import read_bag
from ldcs_ros.bags.sqlite3_file import Sqlite3File
if os.getuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
print(len(list(read_bag(sys.argv[1]).in_order())))
"""


@pytest.mark.parametrize("in_wal", [0, 4])
def test_a_bag_with_a_wal_file_is_read_in_a_folder_that_cannot_be_written(in_wal):
    folder = Path(tempfile.mkdtemp(prefix="ldcs_read_only_"))
    try:
        file = write_sqlite3(folder / "rig.db3", [101325.0, 151325.0] * 4, in_wal=in_wal)
        folder.chmod(0o555)
        words = [sys.executable, "-c", READER, str(file)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
        assert (done.stdout.strip(), done.stderr) == ("8", "")
        assert {path.name for path in folder.iterdir()} <= {"rig.db3", "rig.db3-wal"}
    finally:
        folder.chmod(0o755)
        shutil.rmtree(folder)


@pytest.mark.parametrize("name", ["trial #3", "a%20b", "what?", "a b", "{x};y=1&z"])
def test_a_path_may_hold_any_sign(tmp_path, name):
    (tmp_path / "a b").mkdir()
    write_sqlite3(tmp_path / "a b" / "rig.db3", [121325.0])
    (tmp_path / name).mkdir(exist_ok=True)
    write_sqlite3(tmp_path / name / "rig.db3", [171325.0])
    assert values(read_bag(card(tmp_path / name, ["rig.db3"], 1, storage="sqlite3"))) == [70000]


def test_files_that_metadata_does_not_list_are_left_out_by_reader_and_recover(tmp_path):
    whole = write_mcap(tmp_path / "rig.mcap")
    (tmp_path / "old_copy.mcap").write_bytes(whole.read_bytes()[:400])
    recording = read_bag(card(tmp_path, ["rig.mcap"], 6))
    assert recording.count == 6 and "old_copy.mcap" in recording.notes[0]
    report = recover(tmp_path)
    assert (report.messages, report.rewritten) == (6, ())
    assert read_bag(tmp_path).count == 6


def test_a_listed_file_that_is_missing_is_named(tmp_path):
    write_mcap(tmp_path / "rig_0.mcap")
    assert "lacks rig_1.mcap" in one_line(read_bag, card(tmp_path, ["rig_0.mcap", "rig_1.mcap"], 12))


def test_paths_of_metadata_never_leave_the_folder(tmp_path):
    write_mcap(tmp_path / "secret.mcap")
    (tmp_path / "bag").mkdir()
    write_mcap(tmp_path / "bag" / "rig.mcap")
    assert "lacks secret.mcap" in one_line(read_bag, card(tmp_path / "bag", ["../secret.mcap"], 6))
    assert read_bag(card(tmp_path / "bag", ["bag/rig.mcap"], 6)).count == 6


def test_a_file_that_is_compressed_as_a_whole_is_read_and_a_bomb_is_refused(tmp_path, monkeypatch):
    file = write_mcap(tmp_path / "rig.mcap")
    (tmp_path / "rig.mcap.zstd").write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    folder = card(tmp_path, ["rig.mcap.zstd"], 6, compression="FILE")
    assert values(read_bag(folder)) == [1000, 2000] * 3
    assert "unpack its files with `zstd -d`" in one_line(recover, folder)
    monkeypatch.setattr("ldcs_ros.bags.reader.SMALLEST_BOUND", 100)
    (tmp_path / "rig.mcap.zstd").write_bytes(zstandard.compress(bytes(10**6)))
    assert "unpacks to more than" in one_line(read_bag, folder)


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.mcap")
    assert "no regular file" in one_line(read_bag, tmp_path / "pipe.mcap")
    assert "no regular file" in one_line(read_bag, card(tmp_path, ["pipe.mcap"], 0))


def chunk(file):
    """Return the place of the first chunk."""
    data, position = file.read_bytes(), 8
    while data[position] != 6:
        position += 9 + struct.unpack_from("<Q", data, position + 1)[0]
    return position


def change(file, position, layout, value):
    data = bytearray(file.read_bytes())
    struct.pack_into(layout, data, position, value)
    file.write_bytes(data)


def test_a_chunk_that_claims_more_than_bounds_allow_is_refused_before_it_is_opened(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap")
    change(file, chunk(file) + 9 + 16, "<Q", 10 * 2**30)
    assert f"the chunk at byte {chunk(file)} claims 10737418240 bytes" in one_line(read_bag, file)


def test_one_wrong_bit_outside_of_chunks_is_noticed_by_the_checksum_of_the_data(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", use_chunking=False, enable_data_crcs=True)
    assert values(read_bag(file)) == [1000, 2000] * 3
    place = file.read_bytes().index(struct.pack("<d", 102325.0)) + 5
    change(file, place, "<B", file.read_bytes()[place] ^ 1)
    assert "the checksum of its data is wrong" in one_line(read_bag, file)
    assert recover(file).messages == read_bag(file).count == 6


def test_a_chunk_of_another_compression_is_named(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", enable_crcs=False)
    file.write_bytes(file.read_bytes().replace(b"zstd", b"zxtd"))
    assert f"the chunk at byte {chunk(file)} is compressed with b'zxtd'" in one_line(read_bag, file)


def test_a_damaged_chunk_is_named_and_the_others_are_recovered(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", chunk_size=60)
    place = chunk(file)
    change(file, place + 60, "<Q", 2**64 - 1)
    message = one_line(lambda: list(read_bag(file).in_order()))
    assert f"the chunk at byte {place} is unreadable" in message and "ldcs recover" in message
    original = file.read_bytes()
    assert recover(file).messages == read_bag(file).count == 5
    assert (tmp_path / "rig.mcap.original").read_bytes() == original


@pytest.mark.parametrize("length", [10, 150, 2**62])
def test_a_record_of_a_wrong_length_is_told_and_what_is_whole_is_recovered(tmp_path, length):
    file = write_mcap(tmp_path / "rig.mcap", chunk_size=60)
    change(file, chunk(file) + 1, "<Q", length)
    assert "is damaged" in one_line(read_bag, file)
    report = recover(file)
    assert report.messages == read_bag(file).count == 5
    assert report.dropped > 0


def test_an_index_that_counts_more_than_there_is_is_refused_and_made_again(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", enable_crcs=False)
    data = file.read_bytes()
    statistics = data.index(struct.pack("<QHIIIIQQ", 6, 1, 1, 1, 0, 1, TIMES[0], TIMES[-1]))
    change(file, statistics, "<Q", 9)
    assert "counts 9 messages where 6 were found" in one_line(read_bag, file)
    assert recover(file).messages == read_bag(file).count == 6


@pytest.mark.parametrize("old", [b"float64 fluid", b"MSG: std_msgs/Header", b"string frame_id"])
def test_a_damaged_definition_is_one_line_when_its_message_is_decoded(tmp_path, old):
    file = write_mcap(
        tmp_path / "rig.mcap", compression=OPTIONS["uncompressed"]["compression"], enable_crcs=False
    )
    file.write_bytes(file.read_bytes().replace(old, b"\xff[" + old[2:]))
    recording = read_bag(file)
    assert "the definition of sensor_msgs/msg/FluidPressure" in one_line(
        recording.channels["/v"].messages.__getitem__, 0
    )


@pytest.mark.parametrize("encoding", ["", "ros2msg"])
def test_a_known_type_without_a_definition_is_that_of_ros(tmp_path, encoding):
    file = write_mcap(tmp_path / "rig.mcap", definition=(encoding, b""))
    assert values(read_bag(file)) == [1000, 2000] * 3


MODULE = """\
// generated
#include "std_msgs/msg/Header.idl"
  # include <something.idl>

module sensor_msgs {
  module msg {
    @verbatim (language="comment", text=
      "A pressure." "\\n"
      "# no directive")
    struct FluidPressure {
      std_msgs::msg::Header header;

      @verbatim (language="comment", text=
        "[Pa]")
      double fluid_pressure;
      double variance;
    };
  };
};
"""
HEADER = MODULE[: MODULE.index("  # include")].replace(
    "std_msgs/msg/Header", "builtin_interfaces/msg/Time"
) + (
    "module std_msgs { module msg { struct Header {\n"
    "  builtin_interfaces::msg::Time stamp;\n  string frame_id;\n}; }; };\n"
)


@pytest.mark.parametrize("first", ["", f"{'=' * 80}\nIDL: sensor_msgs/msg/FluidPressure\n"])
@pytest.mark.parametrize("nested", ["", f"{'=' * 80}\nIDL: std_msgs/msg/Header\n{HEADER}"])
def test_definitions_in_idl_are_read_with_their_directives(tmp_path, first, nested):
    file = write_mcap(tmp_path / "rig.mcap", definition=("ros2idl", (first + MODULE + nested).encode()))
    assert values(read_bag(file)) == [1000, 2000] * 3


def test_big_endian_messages_are_read_and_other_encapsulations_are_named(tmp_path):
    big = b"\0\0\0\0" + struct.pack(">iII4xdd", WALL // 10**9, 0, 1, 101425.0, 0.0)
    assert values(read_bag(write_mcap(tmp_path / "big.mcap", contents=[big] * 6))) == [100] * 6
    xcdr2 = b"\0\x07\0\0" + big[4:]
    recording = read_bag(write_mcap(tmp_path / "xcdr2.mcap", contents=[xcdr2] * 6))
    assert "encapsulation" in one_line(recording.channels["/v"].messages.__getitem__, 0)


def test_a_topic_of_two_types_is_refused_and_recover_says_so(tmp_path):
    file = write_mcap(tmp_path / "rig.mcap", also="std_msgs/msg/String")
    assert "carries two types" in one_line(read_bag, file)
    report = recover(file)
    assert report.untouched and "carries two types" in report.refusal


def test_an_empty_file_is_refused_and_left_out_of_a_split_bag(tmp_path):
    (tmp_path / "lone.mcap").write_bytes(b"")
    assert "is empty" in one_line(read_bag, tmp_path / "lone.mcap")
    for number, content in enumerate((b"", bytes(5000), b"\x89MCAP0\r\n")):
        folder = tmp_path / f"bag{number}"
        folder.mkdir()
        write_mcap(folder / "rig_0.mcap")
        (folder / "rig_1.mcap").write_bytes(content)
        report = recover(folder)
        assert report.left_out == ("rig_1.mcap",) and "rig_1.mcap" in str(report) and not report.refusal
        assert (folder / "rig_1.mcap").read_bytes() == content
        assert read_bag(folder).count == 6


def test_metadata_that_counts_otherwise_is_told(tmp_path):
    write_mcap(tmp_path / "rig.mcap")
    assert read_bag(card(tmp_path, ["rig.mcap"], 8)).notes == (
        "metadata.yaml counts 8 messages, the files hold 6",
    )


def test_recover_compares_what_readers_need_and_keeps_the_old_metadata(tmp_path):
    write_mcap(tmp_path / "rig.mcap")
    folder = card(tmp_path, ["rig.mcap"], 6)
    before = (folder / "metadata.yaml").read_bytes()
    report = recover(folder)  # this card has no topics and no span
    assert report.metadata_written and not report.rewritten
    assert (folder / "metadata.yaml.original").read_bytes() == before
    assert recover(folder).untouched and read_bag(folder).count == 6


def test_hostile_types_are_bounded_before_code_is_made_of_them(tmp_path):
    file = tmp_path / "rig.mcap"
    for text in (
        b"Foo[1000000000] header\n" + b"=" * 80 + b"\nMSG: sensor_msgs/Foo\nstring a\n",
        b"FluidPressure header\n",
        b"float64 " + b"a" * 600_000 + b"\n",
    ):
        shutil.rmtree(tmp_path / "x", ignore_errors=True)
        from mcap.writer import Writer

        with open(file, "wb") as stream:
            writer = Writer(stream)
            writer.start(profile="ros2")
            schema = writer.register_schema("sensor_msgs/msg/FluidPressure", "ros2msg", text)
            channel = writer.register_channel("/v", "cdr", schema)
            writer.add_message(channel, WALL, pressure(WALL, 1.0), WALL)
            writer.finish()
        assert "definition of" in one_line(read_bag(file).channels["/v"].messages.__getitem__, 0)

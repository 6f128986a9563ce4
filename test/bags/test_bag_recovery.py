"""A bag left by a kill, a cut or a bad disk is repaired; a sound one is left untouched."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from ldcs_ros.bags import BagWriter, TopicInfo, read_bag, recover
from ldcs_ros.errors import RecordingError

STRING = "std_msgs/msg/String"

RECORDER = """
import sys
from time import monotonic, sleep
from ldcs_ros.bags import BagWriter
writer = BagWriter(sys.argv[1], topics={}, custom_data={'scene': 'paper', 'seed': '1'})
start = monotonic()
while True:
    now = int((monotonic() - start) * 1e9)
    writer.write('/a', 'std_msgs/msg/String', now.to_bytes(8, 'big') * 100, now)
    print(now, flush=True)
    sleep(0.004)
"""


def text(k: int) -> bytes:
    return b"\0\1\0\0" + k.to_bytes(8, "big") * 40


def make_bag(folder: Path, chunks: int = 3, each: int = 20) -> Path:
    """A bag of several chunks; returns its MCAP file."""
    with BagWriter(folder, topics={"/a": TopicInfo(STRING)}, custom_data={"scene": "s"}) as writer:
        file = writer._file
        channel = writer._channels["/a"].id
        for k in range(chunks * each):
            file.add_message(channel, text(k), k * 1000)
            if k % each == each - 1:
                file.flush()
    return folder / f"{folder.name}_0.mcap"


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A sound bag named `bag`, to be copied."""
    return make_bag(tmp_path_factory.mktemp("sound") / "bag").parent


def copied(sound: Path, folder: Path) -> Path:
    """Copy a sound bag; return the copy's MCAP file."""
    shutil.copytree(sound, folder)
    return folder / f"{folder.name}_0.mcap"


def damage(file: Path, position: int) -> None:
    data = bytearray(file.read_bytes())
    data[position] ^= 0xFF
    file.write_bytes(data)


def snapshot(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in folder.iterdir()}


def end_of_data(file: Path) -> int:
    with open(file, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    return chunks[-1].chunk_start_offset + chunks[-1].chunk_length


def test_a_killed_recorder_loses_at_most_one_second(tmp_path):
    folder = tmp_path / "run"
    child = subprocess.Popen([sys.executable, "-c", RECORDER, str(folder)], stdout=subprocess.PIPE, text=True)
    lines = [child.stdout.readline()]
    while int(lines[-1]) < 1.7e9:
        lines.append(child.stdout.readline())
    child.send_signal(signal.SIGKILL)
    lines += child.stdout.read().splitlines()
    child.wait(10)
    written = [int(line) for line in lines if line.strip()]
    with pytest.raises(RecordingError, match=r"was not closed.*ldcs recover"):
        read_bag(folder)
    report = recover(folder)
    recording = read_bag(folder)
    kept = recording.channels["/a"].times.tolist()
    assert kept == written[: len(kept)]
    assert written[-1] - kept[-1] < 1e9
    assert recording.custom_data["scene"] == "paper"
    assert "messages kept" in recording.custom_data["recovered"]
    assert (report.messages, report.rewritten) == (len(kept), ("run_0.mcap",))
    assert recover(folder).untouched


def test_a_bag_that_is_being_recorded_is_not_touched(tmp_path):
    with BagWriter(tmp_path / "bag", topics={}) as writer:
        writer.write("/a", STRING, text(0), 0)
        with pytest.raises(RecordingError, match="is being recorded at this moment"):
            recover(tmp_path / "bag")
    assert read_bag(tmp_path / "bag").count == 1


def test_a_sound_bag_is_left_untouched_and_said_to_be_so(tmp_path):
    make_bag(tmp_path / "bag")
    before = snapshot(tmp_path / "bag")
    report = recover(tmp_path / "bag")
    assert report.untouched and report.messages == 60 and "left untouched" in str(report)
    assert snapshot(tmp_path / "bag") == before


def test_missing_metadata_is_written_again_from_the_file(tmp_path):
    file = make_bag(tmp_path / "bag")
    card, content = tmp_path / "bag" / "metadata.yaml", file.read_bytes()
    before = card.read_text()
    card.unlink()
    report = recover(tmp_path / "bag")
    assert card.read_text() == before
    assert file.read_bytes() == content
    assert report.metadata_written and not report.rewritten


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1))
def test_a_cut_anywhere_keeps_every_whole_chunk(sound, tmp_path_factory, share):
    file = copied(sound, tmp_path_factory.mktemp("cut") / "bag")
    with open(file, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    data = file.read_bytes()
    size = int(share * (len(data) - 1))
    file.write_bytes(data[:size])
    whole = sum(chunk.chunk_start_offset + chunk.chunk_length <= size for chunk in chunks)
    try:
        report = recover(file.parent)
    except RecordingError as error:
        assert "does not begin like an MCAP file" in str(error) and size < chunks[0].chunk_start_offset
        return
    kept = [message.cdr for message in read_bag(file.parent).in_order()]
    assert kept == [text(k) for k in range(len(kept))]
    assert len(kept) == report.messages >= 20 * whole
    assert (file.parent / "bag_0.mcap.original").read_bytes() == data[:size]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_one_wrong_bit_anywhere_never_yields_a_wrong_message(sound, tmp_path_factory, share, bit):
    file = copied(sound, tmp_path_factory.mktemp("bit") / "bag")
    data = bytearray(file.read_bytes())
    data[int(share * len(data))] ^= 1 << bit
    file.write_bytes(data)
    try:
        recover(file.parent)
    except RecordingError as error:
        assert "does not begin like" in str(error) or "profile" in str(error)  # the header has no checksum
        return
    kept = [message.cdr for message in read_bag(file.parent).in_order()]
    assert set(kept) <= {text(k) for k in range(60)} and len(set(kept)) == len(kept)
    assert recover(file.parent).untouched


@pytest.mark.parametrize("compression", list(CompressionType))
def test_whole_messages_of_a_cut_chunk_are_kept(tmp_path, compression):
    file = tmp_path / "rig.mcap"
    noise = os.urandom(400_000)
    with open(file, "wb") as stream:
        writer = Writer(stream, compression=compression)
        writer.start(profile="ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data\n")
        channel = writer.register_channel("/a", "cdr", schema)
        for k in range(400):
            writer.add_message(channel, k, noise[1000 * k : 1000 * (k + 1)], k)
        writer.finish()
    file.write_bytes(file.read_bytes()[:300_000])
    report = recover(file)
    kept = [message.cdr for message in read_bag(file).in_order()]
    assert kept == [noise[1000 * k : 1000 * (k + 1)] for k in range(len(kept))]
    assert 150 <= len(kept) < 300 and report.dropped < 150_000
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.mcap", "rig.mcap.original"]


def test_a_chunk_with_a_wrong_checksum_is_dropped_and_the_others_kept(tmp_path):
    file = make_bag(tmp_path / "bag", chunks=5)
    with open(file, "rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[2]
    damage(file, chunk.chunk_start_offset + chunk.chunk_length - 5)
    report = recover(tmp_path / "bag")
    assert (report.messages, report.dropped) == (80, chunk.chunk_length)
    times = read_bag(tmp_path / "bag").channels["/a"].times // 1000
    assert times.tolist() == [*range(40), *range(60, 100)]


def test_zeros_that_a_power_cut_left_at_the_end_are_dropped(tmp_path):
    file = make_bag(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[: end_of_data(file)] + bytes(5000))
    assert recover(tmp_path / "bag").messages == 60
    assert read_bag(tmp_path / "bag").count == 60


def test_a_wrong_index_is_made_anew(tmp_path):
    file = make_bag(tmp_path / "bag")
    damage(file, file.stat().st_size - 100)
    assert recover(tmp_path / "bag").messages == 60
    assert recover(tmp_path / "bag").untouched


def test_the_files_of_a_split_bag_are_mended_in_their_order(tmp_path):
    folder = tmp_path / "split"
    folder.mkdir()
    for index in (2, 10):
        file = make_bag(tmp_path / f"part{index}")
        file.rename(folder / f"split_{index}.mcap")
    (folder / "split_10.mcap").write_bytes((folder / "split_10.mcap").read_bytes()[:-30])
    report = recover(folder)
    assert (report.rewritten, report.messages) == (("split_10.mcap",), 120)
    assert read_bag(folder).counts == {"/a": 120}


def test_progress_ascends_to_the_whole(tmp_path):
    file = make_bag(tmp_path / "bag", chunks=20)
    file.write_bytes(file.read_bytes()[:-1])
    shares = []
    recover(tmp_path / "bag", progress=shares.append)
    assert shares == sorted(shares) and 0 <= shares[0] < 0.1 and 0.9 < shares[-1] <= 1


def test_no_room_for_the_mended_file_leaves_the_old_one_as_it_was(tmp_path, monkeypatch):
    file = make_bag(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[:-1])
    before = file.read_bytes()
    monkeypatch.setattr("ldcs_ros.bags.bag_file.open_new", lambda path: open("/dev/full", "wb"))  # noqa: SIM115
    with pytest.raises(RecordingError, match=r"No space left.*it is unchanged"):
        recover(tmp_path / "bag")
    assert file.read_bytes() == before
    assert sorted(path.name for path in file.parent.iterdir()) == ["bag_0.mcap", "metadata.yaml"]


def test_what_cannot_be_mended_is_said_in_one_line(tmp_path):
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    for path, reason in (
        (tmp_path / "none", "no bag at"),
        (tmp_path / "folder", "has no .mcap file to repair"),
        (tmp_path / "empty.mcap", "does not begin like an MCAP file"),
    ):
        with pytest.raises(RecordingError, match=reason) as caught:
            recover(path)
        assert "\n" not in str(caught.value)


def test_recovering_is_quick_to_notice_a_record_that_claims_to_be_huge(tmp_path):
    file = make_bag(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[: end_of_data(file)] + struct.pack("<BQ", 6, 2**62) + b"x")
    assert recover(tmp_path / "bag").messages == 60

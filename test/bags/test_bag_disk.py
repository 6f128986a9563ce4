"""A disk that fills up or fails ends the recording with one line, never the run."""

from __future__ import annotations

import errno
import io
import subprocess
import sys
import threading
from time import monotonic, sleep

import pytest
from mcap.writer import CompressionType

from ldcs_ros.bags import BagWriter, read_bag, recover
from ldcs_ros.errors import RecordingError

STRING = "std_msgs/msg/String"

LIMITED = """
import resource, signal, sys
from time import sleep
from ldcs_ros.bags import BagWriter
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
writer = BagWriter(sys.argv[1], topics={}, flush_period=0.05)
import random
noise = random.Random(1)
k = 0
while writer.error is None and k < 100_000:
    writer.write('/a', 'std_msgs/msg/String', noise.randbytes(1000), k)
    k += 1
    sleep(0.0005)
writer.write('/a', 'std_msgs/msg/String', b'late', k)
writer.close()
print(writer.error)
print(writer.count - writer.lost + 1)
"""


class SmallDisk(io.FileIO):
    """A file on a disk that has room for so many bytes."""

    room = 100_000

    def write(self, data):
        if self.tell() + len(data) > self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)


def noise(k: int) -> bytes:
    return k.to_bytes(4, "big") * 500


def small_disk(path):
    return io.BufferedWriter(SmallDisk(path, "x"))


def test_a_full_disk_stops_the_recording_and_the_rest_can_be_mended(tmp_path, monkeypatch):
    monkeypatch.setattr("ldcs_ros.bags.bag_file.open_new", small_disk)
    monkeypatch.setattr("ldcs_ros.bags.bag_file.COMPRESSION", CompressionType.NONE)
    folder = tmp_path / "full"
    writer = BagWriter(folder, topics={}, flush_period=0.01)
    k = 0
    start = monotonic()
    while writer.error is None and monotonic() < start + 10:
        writer.write("/a", STRING, noise(k), k)
        k += 1
        sleep(0.001)
    assert "No space left on device" in writer.error and "ldcs recover" in writer.error
    assert "\n" not in writer.error
    writer.write("/a", STRING, b"after", k)
    writer.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "bag full"]
    assert writer.lost >= 1
    with pytest.raises(RecordingError, match="ldcs recover"):
        read_bag(folder)
    monkeypatch.undo()
    report = recover(folder)
    assert report.messages >= writer.count - (writer.lost - 1)
    kept = [message.cdr for message in read_bag(folder).in_order()]
    assert kept == [noise(i) for i in range(len(kept))] and len(kept) == report.messages


def test_a_file_size_limit_of_the_system_is_a_clear_error_too(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    error, kept = done.stdout.splitlines()
    assert "File too large" in error
    assert recover(tmp_path / "bag").messages >= int(kept) > 0
    assert done.stderr == ""


def test_a_disk_that_is_full_from_the_start_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("ldcs_ros.bags.bag_file.open_new", lambda path: open("/dev/full", "wb"))  # noqa: SIM115
    with pytest.raises(RecordingError, match="cannot be written: No space left on device"):
        BagWriter(tmp_path / "bag", topics={})
    assert not (tmp_path / "bag").exists()


def test_a_disk_that_fails_only_at_the_end_is_noticed(tmp_path, monkeypatch):
    def fail(descriptor):
        raise OSError(errno.EIO, "Input/output error")

    writer = BagWriter(tmp_path / "bag", topics={})
    writer.write("/a", STRING, noise(1), 1)
    monkeypatch.setattr("ldcs_ros.bags.bag_file.os.fsync", fail)
    writer.close()
    monkeypatch.undo()
    assert "Input/output error" in writer.error
    assert recover(tmp_path / "bag").messages == 1


def test_a_disk_that_does_not_answer_does_not_hold_up_close(tmp_path, monkeypatch):
    released = []

    def hang(descriptor):
        while not released:
            sleep(0.01)

    writer = BagWriter(tmp_path / "bag", topics={})
    writer.write("/a", STRING, noise(1), 1)
    monkeypatch.setattr("ldcs_ros.bags.bag_file.os.fsync", hang)
    monkeypatch.setattr("ldcs_ros.bags.writer.CLOSE_TIMEOUT", 0.2)
    writer.close()
    released.append(True)
    assert "does not answer" in writer.error


def test_a_writer_blocked_by_a_full_queue_goes_on_when_the_disk_fails(tmp_path, monkeypatch):
    monkeypatch.setattr("ldcs_ros.bags.bag_file.open_new", small_disk)
    monkeypatch.setattr("ldcs_ros.bags.writer.QUEUE_LIMIT", 20_000)
    monkeypatch.setattr("ldcs_ros.bags.writer.CHUNK_SIZE", 10_000)
    monkeypatch.setattr("ldcs_ros.bags.bag_file.CHUNK_SIZE", 10_000)
    monkeypatch.setattr("ldcs_ros.bags.bag_file.COMPRESSION", CompressionType.NONE)
    writer = BagWriter(tmp_path / "bag", topics={})
    for k in range(200):
        writer.write("/a", STRING, noise(k), k)
    writer.close()
    assert "No space left" in writer.error

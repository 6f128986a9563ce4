"""A bag folder that is removed, renamed or cut while it is written: noticed, told, and the rest saved beside it."""

from __future__ import annotations

import os
import shutil
import time

import pytest

from ldcs_ros.bags import BagWriter, TopicInfo, read_bag
from ldcs_ros.messages import messages

TOPIC, TYPE = "/ldcs/pressure_command", "std_msgs/msg/Float64MultiArray"


def remove(folder):
    shutil.rmtree(folder)


def rename(folder):
    folder.rename(folder.with_name("moved"))


def cut(folder):
    os.truncate(next(folder.glob("*.mcap")), 0)


def replace(folder):
    path = next(folder.glob("*.mcap"))
    path.rename(path.with_suffix(".old"))
    path.write_bytes(b"not ours")


def until(condition):
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("disturb", [remove, rename, cut, replace])
def test_a_disturbed_recording_says_so_and_saves_the_rest(tmp_path, disturb):
    folder = tmp_path / "bag"
    with BagWriter(folder, topics={TOPIC: TopicInfo(TYPE)}, flush_period=0.05) as writer:
        for k in range(10):
            writer.write(TOPIC, TYPE, messages.pressure_command([float(k)]), k)
        until(lambda: writer._flushed == 10)
        time.sleep(0.1)
        assert writer.error is None
        disturb(folder)
        for k in range(10, 15):
            writer.write(TOPIC, TYPE, messages.pressure_command([float(k)]), k)
        until(lambda: writer.error is not None)
        for k in range(15, 20):
            writer.write(TOPIC, TYPE, messages.pressure_command([float(k)]), k)
    assert "disturbed" in writer.error and "bag_rest1" in writer.error and "\n" not in writer.error
    assert writer.lost == 10
    rest = read_bag(tmp_path / "bag_rest1")
    assert list(rest.channels[TOPIC].times) == list(range(10, 20))


def test_a_folder_removed_just_before_the_end_is_noticed(tmp_path):
    writer = BagWriter(tmp_path / "bag", topics={TOPIC: TopicInfo(TYPE)}, flush_period=60.0)
    writer.write(TOPIC, TYPE, messages.pressure_command([1.0]), 5)
    remove(tmp_path / "bag")
    writer.close()
    assert writer.error is not None
    assert list(read_bag(tmp_path / "bag_rest1").channels[TOPIC].times) == [5]


def test_without_a_place_for_the_rest_the_recording_ends(tmp_path):
    parent = tmp_path / "parent"
    writer = BagWriter(parent / "bag", topics={TOPIC: TopicInfo(TYPE)}, flush_period=0.05)
    remove(parent)
    until(lambda: writer.error is not None)
    writer.write(TOPIC, TYPE, messages.pressure_command([1.0]), 5)
    writer.close()
    assert not parent.exists() and writer.lost == 1

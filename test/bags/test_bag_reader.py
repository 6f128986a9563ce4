"""Bags of ours and of others as Recordings, and what is said about those that cannot be read."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as ForeignWriter
from rosbags.typesys import Stores, get_typestore

from ldcs_ros.bags import BagWriter, Message, Recording, TopicInfo, read_bag
from ldcs_ros.bags.metadata import parse_foreign_yaml
from ldcs_ros.errors import RecordingError

POSE = "geometry_msgs/msg/PoseStamped"
TYPES = ("std_msgs/msg/String", "std_msgs/msg/Empty", "sensor_msgs/msg/PointCloud2")


def write_foreign(folder, storage, cdr, compression=None, version=9):
    with ForeignWriter(folder, version=version, storage_plugin=storage) as writer:
        connection = writer.add_connection("/trakstar", POSE, typestore=get_typestore(Stores.ROS2_KILTED))
        for time in (30, 10, 20):
            writer.write(connection, time, cdr)


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("version", [8, 9])
def test_a_rig_s_bag_is_read_whatever_its_storage(tmp_path, make_pose, storage, version):
    write_foreign(tmp_path / "rig", storage, make_pose(0.5), version=version)
    recording = read_bag(tmp_path / "rig")
    channel = recording.channels["/trakstar"]
    assert channel.times.tolist() == [10, 20, 30]
    assert [m.pose.position.x for m in channel.messages] == [0.5] * 3
    assert (recording.start, recording.end, recording.count, recording.custom_data) == (10, 30, 3, {})


def test_a_bag_whose_messages_are_compressed_is_read(tmp_path, make_pose):
    writer = ForeignWriter(tmp_path / "rig", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/p", POSE, typestore=get_typestore(Stores.ROS2_KILTED))
        writer.write(connection, 1, make_pose(2.0))
    assert read_bag(tmp_path / "rig").channels["/p"].messages[0].pose.position.x == 2.0


def test_a_lone_file_is_read_without_its_folder(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={}, custom_data={"seed": "3"}) as writer:
        writer.write("/a", POSE, make_pose(1.0), 4)
    recording = read_bag(tmp_path / "bag" / "bag_0.mcap")
    assert (recording.count, recording.custom_data) == (1, {"seed": "3"})


def test_a_topic_without_messages_is_an_empty_channel(tmp_path):
    BagWriter(tmp_path / "bag", topics={"/a": TopicInfo(POSE)}).close()
    recording = read_bag(tmp_path / "bag")
    channel = recording.channels["/a"]
    assert (len(channel), channel.times.shape, list(channel.messages)) == (0, (0,), [])
    assert (recording.start, recording.end, list(recording.in_order())) == (0, 0, [])


def test_messages_are_decoded_one_by_one_and_in_slices(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={}) as writer:
        for k in range(5):
            writer.write("/a", POSE, make_pose(k), k)
        writer.write("/a", POSE, b"\0\1\0\0 broken", 5)
    messages = read_bag(tmp_path / "bag").channels["/a"].messages
    assert [m.pose.position.x for m in messages[1:4]] == [1, 2, 3]
    with pytest.raises(RecordingError, match=f"on /a at 0.000000 s is no valid {POSE}"):
        messages[-1]


def test_some_topics_can_be_read_in_order_without_the_others(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={"/c": TopicInfo(POSE)}) as writer:
        for k in range(6):
            writer.write("/ab"[0] + "ab"[k % 2], POSE, make_pose(k), k)
    recording = read_bag(tmp_path / "bag")
    assert [m.time for m in recording.in_order(["/b"])] == [1, 3, 5]
    assert list(recording.in_order(["/c"])) == []
    with pytest.raises(RecordingError, match="has no topic '/d'; it has"):
        recording.in_order(["/d"])


def test_a_run_held_in_memory_is_the_same_type(make_pose):
    emitted = [Message("/a", POSE, make_pose(k), t) for k, t in enumerate((2, 1, 1))]
    recording = Recording.from_messages(emitted, custom_data={"seed": "1"})
    assert [m.pose.position.x for m in recording.channels["/a"].messages] == [1, 2, 0]
    assert (recording.start, recording.end, recording.count) == (1, 2, 3)
    assert recording.decode(next(recording.in_order())).pose.position.x == 1


def test_what_is_no_bag_is_said_in_one_line(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "fake.mcap").write_text("hello, this is not what it says")
    (tmp_path / "empty.mcap").write_text("")
    (tmp_path / "fake.db3").write_text("hello")
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    for name, reason in (
        ("none", "no bag at"),
        ("folder", "it has no metadata.yaml and no .mcap or .db3 file"),
        ("text.txt", "expected a bag folder"),
        ("fake.mcap", "does not begin like one"),
        ("empty.mcap", "is empty"),
        ("fake.db3", "damaged or no ROS 2 bag"),
        ("bad", "damaged or no ROS 2 bag"),
    ):
        with pytest.raises(RecordingError, match=reason) as caught:
            read_bag(tmp_path / name)
        assert "\n" not in str(caught.value), name


def test_damage_in_the_middle_is_said_while_reading(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={}) as writer:
        for k in range(50):
            writer.write("/a", POSE, make_pose(k), k)
    file = tmp_path / "bag" / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    middle = data.index(b"zstd") + 60
    data[middle] ^= 0xFF
    file.write_bytes(data)
    with pytest.raises(RecordingError, match="ldcs recover"):
        list(read_bag(tmp_path / "bag").in_order())


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    stream=st.lists(
        st.tuples(st.integers(0, 2), st.binary(max_size=200), st.integers(0, 2**63 - 2)), max_size=60
    )
)
def test_any_stream_of_messages_comes_back_whole_and_by_time(tmp_path_factory, stream):
    folder = tmp_path_factory.mktemp("stream") / "bag"
    written = [Message(f"/t{kind}", TYPES[kind], data, time) for kind, data, time in stream]
    with BagWriter(folder, topics={}) as writer:
        for message in written:
            writer.write(*message)
    assert writer.error is None
    recording = read_bag(folder)
    assert list(recording.in_order()) == sorted(written, key=lambda message: message.time)
    assert recording.counts == {t: sum(m.topic == t for m in written) for t in {m.topic for m in written}}


def test_channels_read_in_one_pass_hold_what_each_would_hold_alone(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={"/c": TopicInfo(POSE)}) as writer:
        for k in range(20):
            writer.write("/a" if k % 3 else "/b", POSE, make_pose(k), 1000 - k)
    alone, together = read_bag(tmp_path / "bag"), read_bag(tmp_path / "bag")
    together.load(["/a", "/b", "/c"])
    for topic in ("/a", "/b", "/c"):
        assert together.channels[topic].raw == alone.channels[topic].raw
        assert together.channels[topic].times.tolist() == alone.channels[topic].times.tolist()
    with pytest.raises(RecordingError, match="no topic '/d'"):
        together.load(["/d"])


@pytest.mark.parametrize(
    ("text", "content"),
    [("{a: 1, a: 2}", {"a": 2}), ("a: 2020-13-45", None), ("a: [", None), ("[" * 5000, None)],
    ids=["repeated key", "no date", "cut off", "nested"],
)
def test_yaml_of_other_recorders_is_read_as_far_as_possible(text, content):
    assert parse_foreign_yaml(text) == content

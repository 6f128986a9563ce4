"""What BagWriter writes, seen by this package, by rosbags and by the decoder of mcap-ros2-support."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from ldcs_ros.bags import BagWriter, Qos, TopicInfo, read_bag
from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.errors import RecordingError

POSE = "geometry_msgs/msg/PoseStamped"
STATE = "ldcs_test_msgs/msg/State"
STATE_TEXT = "std_msgs/Header header\nfloat64[] position  # [m]\nuint32 links\nldcs_test_msgs/Part[] parts\n"
PART_TEXT = "string name\nfloat64[3] size\n"
POSE_HASH = "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"


def record(folder: Path, messages, topics=None, **options) -> BagWriter:
    with BagWriter(folder, topics=topics or {}, **options) as writer:
        for topic, message_type, cdr, time in messages:
            writer.write(topic, message_type, cdr, time)
    assert writer.error is None
    return writer


def test_what_is_written_is_read_back_to_the_bit(tmp_path, make_pose):
    written = [(f"/P{i % 2}/pose", POSE, make_pose(0.1 * i), i * 12_500_000) for i in range(500)]
    record(tmp_path / "bag", written)
    assert [tuple(m) for m in read_bag(tmp_path / "bag").in_order()] == written
    with Reader(tmp_path / "bag") as reader:
        assert [(c.topic, c.msgtype, d, t) for c, t, d in reader.messages()] == written


def test_the_decoder_of_mcap_ros2_support_reads_the_bag(tmp_path, make_pose):
    record(tmp_path / "bag", [("/P0/pose", POSE, make_pose(0.25), 5)])
    with open(tmp_path / "bag" / "bag_0.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        ((schema, channel, message, pose),) = reader.iter_decoded_messages()
        summary = reader.get_summary()
        header = reader.get_header()
    assert (pose.pose.position.x, pose.header.frame_id) == (0.25, "ldcs_base")
    assert (schema.name, schema.encoding, channel.message_encoding) == (POSE, "ros2msg", "cdr")
    assert channel.metadata["topic_type_hash"] == POSE_HASH
    assert (message.log_time, message.publish_time, header.profile) == (5, 5, "ros2")
    assert summary.statistics.message_count == 1


def test_metadata_has_every_field_that_rosbag2_reads(tmp_path, make_pose):
    topics = {
        "/P0/pose": TopicInfo(POSE, Qos(reliability="best_effort", depth=3)),
        "/tf_static": TopicInfo("tf2_msgs/msg/TFMessage", Qos(durability="transient_local", depth=1)),
    }
    messages = [("/P0/pose", POSE, make_pose(i), 1000 + i) for i in range(3)]
    record(tmp_path / "run", messages, topics, custom_data={"seed": "1"})
    card = yaml.safe_load((tmp_path / "run" / "metadata.yaml").read_text())
    assert list(card) == ["rosbag2_bagfile_information"]
    info = card["rosbag2_bagfile_information"]
    infinite = {"sec": 9223372036, "nsec": 854775807}
    profile = {
        "history": "keep_last",
        "depth": 3,
        "reliability": "best_effort",
        "durability": "volatile",
        "deadline": infinite,
        "lifespan": infinite,
        "liveliness": "automatic",
        "liveliness_lease_duration": infinite,
        "avoid_ros_namespace_conventions": False,
    }
    pose, transforms = info.pop("topics_with_message_count")
    assert pose == {
        "topic_metadata": {
            "name": "/P0/pose",
            "type": POSE,
            "serialization_format": "cdr",
            "offered_qos_profiles": [profile],
            "type_description_hash": POSE_HASH,
        },
        "message_count": 3,
    }
    assert transforms["message_count"] == 0
    assert transforms["topic_metadata"]["offered_qos_profiles"][0]["durability"] == "transient_local"
    span = {
        "starting_time": {"nanoseconds_since_epoch": 1000},
        "duration": {"nanoseconds": 2},
        "message_count": 3,
    }
    assert info == {
        "version": 9,
        "storage_identifier": "mcap",
        **span,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": ["run_0.mcap"],
        "files": [{"path": "run_0.mcap", **span}],
        "custom_data": {"seed": "1"},
        "ros_distro": "kilted",
    }


def test_the_file_carries_its_metadata_and_quality_of_service(tmp_path, make_pose):
    record(tmp_path / "bag", [("/a", POSE, make_pose(1), 7)], {"/a": TopicInfo(POSE, Qos(depth=2))})
    with open(tmp_path / "bag" / "bag_0.mcap", "rb") as stream:
        reader = make_reader(stream)
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        (channel,) = reader.get_summary().channels.values()
    card = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    assert yaml.safe_load(records["rosbag2"]["serialized_metadata"]) == card["rosbag2_bagfile_information"]
    assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["depth"] == 2


@pytest.mark.parametrize(
    "text", ["title: a\n  b: 1\n", "1", "true", "", " lead", "trail \nx", "µ°→", "#", "a: b"]
)
def test_custom_data_comes_back_as_the_same_text(tmp_path, text):
    record(tmp_path / "bag", [], custom_data={"scene": text})
    assert read_bag(tmp_path / "bag").custom_data == {"scene": text}
    with Reader(tmp_path / "bag") as reader:
        assert reader.storage.metadata.custom == {"scene": text}


def test_types_that_ros_does_not_have_come_from_their_definition(tmp_path):
    definitions = {STATE: STATE_TEXT, "ldcs_test_msgs/msg/Part": PART_TEXT}
    store = Schemas(definitions).typestore
    with BagWriter(tmp_path / "bag", topics={"/state": TopicInfo(STATE)}, definitions=definitions) as writer:
        header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](1, 2), "f")
        state = store.types[STATE](header, np.array([0.5, 1.5]), 4, [])
        writer.write("/state", STATE, store.serialize_cdr(state, STATE), 9)
    (message,) = read_bag(tmp_path / "bag").channels["/state"].messages
    assert (list(message.position), message.links) == ([0.5, 1.5], 4)


def test_a_type_may_be_registered_while_recording(tmp_path):
    with BagWriter(tmp_path / "bag", topics={}) as writer:
        with pytest.raises(RecordingError, match=r"register the .msg text"):
            writer.write("/part", "ldcs_test_msgs/msg/Part", b"\0\1\0\0", 0)
        writer.register({"ldcs_test_msgs/msg/Part": "uint8 x\n"})
        writer.write("/part", "ldcs_test_msgs/msg/Part", b"\0\1\0\0\7", 0)
    assert read_bag(tmp_path / "bag").channels["/part"].messages[0].x == 7


def test_messages_out_of_order_are_read_by_time_and_ties_as_written(tmp_path, make_pose):
    times = [5, 3, 3, 9, 0, 3]
    record(tmp_path / "bag", [("/a", POSE, make_pose(i), t) for i, t in enumerate(times)])
    recording = read_bag(tmp_path / "bag")
    channel = recording.channels["/a"]
    assert channel.times.tolist() == [0, 3, 3, 3, 5, 9]
    assert [m.pose.position.x for m in channel.messages] == [4, 1, 2, 5, 0, 3]
    assert (recording.start, recording.end) == (0, 9)


def test_an_existing_folder_is_refused_and_left_untouched(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "precious").write_text("data")
    with pytest.raises(RecordingError, match="exists already and is never overwritten"):
        BagWriter(folder, topics={})
    assert [file.name for file in folder.iterdir()] == ["precious"]


def test_a_path_that_cannot_be_written_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be written: File exists") as caught:
        BagWriter(tmp_path / "file" / "bag", topics={})
    assert "\n" not in str(caught.value)


def test_a_writer_that_cannot_start_leaves_nothing_behind(tmp_path):
    with pytest.raises(RecordingError, match="'no_msgs/msg/Such' cannot be recorded"):
        BagWriter(tmp_path / "out" / "bag", topics={"/a": TopicInfo("no_msgs/msg/Such")})
    with pytest.raises(RecordingError, match="must be a text, got int"):
        BagWriter(tmp_path / "out" / "bag", topics={}, custom_data={"seed": 1})
    assert not (tmp_path / "out").exists()


def test_a_mistake_of_the_caller_is_said_at_once(tmp_path, make_pose):
    with BagWriter(tmp_path / "bag", topics={"/a": TopicInfo(POSE)}) as writer:
        with pytest.raises(RecordingError, match="a topic has one type"):
            writer.write("/a", "std_msgs/msg/Empty", b"", 0)
        with pytest.raises(RecordingError, match="times >= 0"):
            writer.write("/a", POSE, make_pose(0), -1)
    assert writer.error is None


def test_close_may_be_repeated_and_later_messages_count_as_lost(tmp_path, make_pose):
    writer = record(tmp_path / "bag", [("/a", POSE, make_pose(0), 0)])
    writer.write("/a", POSE, make_pose(1), 1)
    writer.close()
    assert (writer.count, writer.lost, writer.error) == (1, 1, None)
    assert read_bag(tmp_path / "bag").count == 1


def test_a_writer_that_nobody_closed_is_closed_at_exit(tmp_path):
    program = (
        "import sys; from ldcs_ros.bags import BagWriter\n"
        "writer = BagWriter(sys.argv[1], topics={})\n"
        "writer.write('/a', 'std_msgs/msg/Empty', b'\\0\\1\\0\\0\\0', 1)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(tmp_path / "bag")], check=True, timeout=30)
    assert read_bag(tmp_path / "bag").count == 1


@pytest.mark.timed
def test_a_write_costs_the_caller_less_than_20_microseconds(tmp_path):
    cloud = bytes(162 * 24)
    costs = []
    with BagWriter(tmp_path / "bag", topics={}) as writer:
        for k in range(2000):
            start = perf_counter()
            writer.write("/nodes", "sensor_msgs/msg/PointCloud2", cloud, k)
            costs.append(perf_counter() - start)
    assert sorted(costs)[len(costs) // 2] < 20e-6


def test_a_queue_that_is_full_blocks_and_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("ldcs_ros.bags.writer.QUEUE_LIMIT", 2000)
    monkeypatch.setattr("ldcs_ros.bags.writer.CHUNK_SIZE", 1500)
    messages = [("/a", "std_msgs/msg/String", bytes(1000), k) for k in range(200)]
    record(tmp_path / "bag", messages)
    assert read_bag(tmp_path / "bag").count == 200

"""What a recorder keeps in memory for each chunk that is on the disk already."""

from __future__ import annotations

import tracemalloc

from ldcs_ros.bags.bag_file import BagFile
from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.bags.topics import TopicInfo

POSE = "geometry_msgs/msg/PoseStamped"


def test_an_hour_of_recording_keeps_a_few_megabytes_of_index(tmp_path):
    file = BagFile(tmp_path / "long.mcap")
    schema = Schemas()[POSE]
    channels = [file.add_topic(f"/{k}", TopicInfo(POSE), schema) for k in range(20)]

    def chunks(count):
        for k in range(count):
            for channel in channels:
                file.add_message(channel, b"\0\1\0\0", k)
            file.flush()

    chunks(20)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    chunks(500)
    grown = (tracemalloc.get_traced_memory()[0] - before) / 500
    tracemalloc.stop()
    file.abandon()
    assert grown * 7200 < 4e6, f"{grown:.0f} bytes a chunk, two chunks a second"

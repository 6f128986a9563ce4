"""A program with ROS and without this package: reads one cloud and prints its content as JSON."""

import json
import struct
import sys

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

clouds = []
rclpy.init()
node = Node("plain_reader")
node.create_subscription(PointCloud2, "/ldcs/nodes", clouds.append, 10)
for _ in range(500):
    rclpy.spin_once(node, timeout_sec=0.02)
    if clouds:
        break
cloud = clouds[0]
fields = {field.name: field.offset for field in cloud.fields}
last = bytes(cloud.data)[-cloud.point_step :]
print(
    json.dumps(
        {
            "size": [cloud.height, cloud.width],
            "last": [struct.unpack_from("<f", last, fields[name])[0] for name in "xyz"],
            "frame": cloud.header.frame_id,
            "ours": [name for name in sys.modules if name.startswith("ldcs")],
        }
    )
)

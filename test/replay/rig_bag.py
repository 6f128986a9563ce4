"""Bags as rigs record them: other names, units, types and clocks, written with rosbags alone."""

from __future__ import annotations

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

WALL = 1_790_000_000_000_000_000
"""A time of the wall clock [ns]."""
STORE = get_typestore(Stores.ROS2_HUMBLE)


def build(kind, **fields):
    return STORE.types[kind](**fields)


def array(values):
    layout = build("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    return build("std_msgs/msg/Float64MultiArray", layout=layout, data=np.asarray(values, dtype=np.float64))


def header(stamp_ns, frame=""):
    stamp = build("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return build("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def fluid(stamp_ns, pressure):
    kind = "sensor_msgs/msg/FluidPressure"
    return build(kind, header=header(stamp_ns), fluid_pressure=float(pressure), variance=0.0)


def transform(stamp_ns, child, position):
    x, y, z = (float(part) for part in position)
    return build(
        "geometry_msgs/msg/TransformStamped",
        header=header(stamp_ns, "trakstar_base"),
        child_frame_id=child,
        transform=build(
            "geometry_msgs/msg/Transform",
            translation=build("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        ),
    )


def wrench(stamp_ns, frame, force):
    vector = "geometry_msgs/msg/Vector3"
    return build(
        "geometry_msgs/msg/WrenchStamped",
        header=header(stamp_ns, frame),
        wrench=build(
            "geometry_msgs/msg/Wrench",
            force=build(vector, x=force[0], y=force[1], z=force[2]),
            torque=build(vector, x=0.0, y=0.0, z=0.0),
        ),
    )


def write(folder, messages, *, storage="mcap"):
    """Write (topic, log time [ns], message or (type, bytes)) into a new bag, in the order given."""
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, time, message in messages:
            kind, cdr = message if isinstance(message, tuple) else (message.__msgtype__, None)
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = STORE.serialize_cdr(message, kind) if cdr is None else cdr
            writer.write(connections[topic], time, data)
    return folder

"""The small messages of the twin: poses, transforms, joints, pressures, clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ldcs_ros.messages.cdr import encode, header, message_class, time_message
from ldcs_ros.messages.frames import PLAIN, Frames
from ldcs_ros.messages.message_types import RosMessage
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.sensors import Measurement

# The transmitter has x and z reversed against the axes that its ROS driver reports: half a turn about y.
_TRANSMITTER = np.array([-1.0, 1.0, -1.0])


def pose(time_ns: int, position: np.ndarray, orientation: np.ndarray, *, frame: str = BASE_FRAME) -> bytes:
    """Return a PoseStamped: position in the frame [m], shape (3,); quaternion x, y, z, w."""
    x, y, z = position.tolist()
    return encode(
        message_class("geometry_msgs/msg/PoseStamped")(
            header=header(time_ns, frame),
            pose=message_class("geometry_msgs/msg/Pose")(
                position=message_class("geometry_msgs/msg/Point")(x=x, y=y, z=z),
                orientation=_quaternion(orientation),
            ),
        )
    )


def transform(
    time_ns: int, frame: str, child: str, position: np.ndarray, orientation: np.ndarray
) -> RosMessage:
    """Return a TransformStamped object from `child` to `frame`; position [m], shape (3,), quaternion x, y, z, w."""
    x, y, z = position.tolist()
    return message_class("geometry_msgs/msg/TransformStamped")(
        header=header(time_ns, frame),
        child_frame_id=child,
        transform=message_class("geometry_msgs/msg/Transform")(
            translation=message_class("geometry_msgs/msg/Vector3")(x=x, y=y, z=z),
            rotation=_quaternion(orientation),
        ),
    )


def trakstar(time_ns: int, measured: Measurement, frames: Frames = PLAIN) -> bytes:
    """Return a probe's TransformStamped as the ROS 2 driver of the tracker sends it."""
    child = frames.named(f"trakstar{measured.probe}")
    return encode(transform(time_ns, frames.tracker, child, measured.position, measured.orientation))


def trakstar_raw(time_ns: int, measured: Measurement, frames: Frames = PLAIN) -> bytes:
    """Return the same in the transmitter's own axes, before the driver turns them."""
    x, y, z, w = measured.orientation
    turned = np.array([z, w, -x, -y])  # half a turn about y, times the orientation
    child = frames.named(f"trakstar{measured.probe}_raw")
    return encode(transform(time_ns, frames.tracker, child, measured.position * _TRANSMITTER, turned))


def transforms(stamped: Sequence[RosMessage]) -> bytes:
    """Return a TFMessage of TransformStamped objects."""
    return encode(message_class("tf2_msgs/msg/TFMessage")(transforms=list(stamped)))


def joint_states(
    time_ns: int, names: Sequence[str], angle: np.ndarray, rate: np.ndarray, torque: np.ndarray
) -> bytes:
    """Return a JointState: angles [rad], rates [rad/s], drive torques [N m], each of shape (n_joints,)."""
    return encode(
        message_class("sensor_msgs/msg/JointState")(
            header=header(time_ns, ""),
            name=list(names),
            position=_flat(angle),
            velocity=_flat(rate),
            effort=_flat(torque),
        )
    )


def torque_command(time_ns: int, names: Sequence[str], torque: np.ndarray) -> bytes:
    """Return the JointState that commands these joint torques [N m], shape (n_joints,)."""
    return joint_states(time_ns, names, np.zeros(0), np.zeros(0), torque)


def pressure_command(pressure: np.ndarray) -> bytes:
    """Return the Float64MultiArray that commands these gauge pressures [Pa], shape (n_arms,)."""
    layout = message_class("std_msgs/msg/MultiArrayLayout")(dim=[], data_offset=0)
    return encode(message_class("std_msgs/msg/Float64MultiArray")(layout=layout, data=_flat(pressure)))


def wrench_command(time_ns: int, frame: str, force: Sequence[float], torque: Sequence[float]) -> bytes:
    """Return the WrenchStamped that commands a force [N] and a torque [N m] at a frame."""
    vector = message_class("geometry_msgs/msg/Vector3")
    wrench = message_class("geometry_msgs/msg/Wrench")(
        force=vector(x=force[0], y=force[1], z=force[2]), torque=vector(x=torque[0], y=torque[1], z=torque[2])
    )
    stamped = message_class("geometry_msgs/msg/WrenchStamped")
    return encode(stamped(header=header(time_ns, frame), wrench=wrench))


def fluid_pressure(time_ns: int, frame: str, absolute: float, variance: float) -> bytes:
    """Return a FluidPressure: absolute pressure [Pa] and its variance [Pa^2], 0 for unknown."""
    return encode(
        message_class("sensor_msgs/msg/FluidPressure")(
            header=header(time_ns, frame), fluid_pressure=absolute, variance=variance
        )
    )


def text(content: str) -> bytes:
    """Return a String."""
    return encode(message_class("std_msgs/msg/String")(data=content))


def clock(time_ns: int) -> bytes:
    """Return a Clock."""
    return encode(message_class("rosgraph_msgs/msg/Clock")(clock=time_message(time_ns)))


def _quaternion(orientation: np.ndarray) -> RosMessage:
    x, y, z, w = orientation.tolist()
    return message_class("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w)


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ravel(np.asarray(values, dtype=np.float64))

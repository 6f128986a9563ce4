"""Values of messages of any type: the usual field of each type, or a path such as `pressures.value`."""

from __future__ import annotations

import numpy as np

from ldcs_ros.errors import MappingError
from ldcs_ros.schema.units import STANDARD_ATMOSPHERE

FLUID_PRESSURE = "sensor_msgs/msg/FluidPressure"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

# Type -> path of the scalar or array that a rig sends with it.
VALUES = {
    **{
        f"std_msgs/msg/{number}{shape}": "data"
        for number in ("Float64", "Float32", "Int64", "Int32", "Int16", "UInt64", "UInt32", "UInt16", "UInt8")
        for shape in ("", "MultiArray")
    },
    FLUID_PRESSURE: "fluid_pressure",
    "sensor_msgs/msg/JointState": "effort",
}
# Type -> path of the position (x, y, z).
POSITIONS = {
    "geometry_msgs/msg/PoseStamped": "pose.position",
    "geometry_msgs/msg/Pose": "position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Point": "",
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    TRANSFORMS: "transform.translation",
    "nav_msgs/msg/Odometry": "pose.pose.position",
}


def numbers(message: object, path: str, message_type: str) -> np.ndarray:
    """Return the numbers at a path of a message, shape (n,); '' means the usual field of the type.

    A path is attribute names with dots between; a name that meets an array is taken of each of its elements.

    Raises:
        MappingError: The type has no usual field, there is no such field, or it holds no numbers.
    """
    if not path and message_type not in VALUES:
        raise MappingError(
            f"{message_type} has no usual field for a number; name one with 'field:', it has {_names(message)}"
        )
    value = at_path(message, path or VALUES[message_type])
    try:
        return np.atleast_1d(np.asarray(value, dtype=float)).ravel()
    except (TypeError, ValueError) as error:
        raise MappingError(f"field {path!r} of {message_type} holds no numbers") from error


def parts(message: object, child: str) -> list[object]:
    """Return what a message says of a child frame, '' for any: a TFMessage holds several with stamps of their own."""
    found = getattr(message, "transforms", [message])
    return [one for one in found if not child or getattr(one, "child_frame_id", child) == child]


def position(message: object, path: str, message_type: str) -> np.ndarray:
    """Return the position in a message, or in one transform of it [its unit], shape (3,).

    Raises:
        MappingError: The type has no usual field, or there is no such field.
    """
    if not path and message_type not in POSITIONS:
        raise MappingError(
            f"{message_type} has no usual field for a position; name one with 'field:', it has {_names(message)}"
        )
    value = at_path(message, path or POSITIONS[message_type])
    if hasattr(value, "x"):
        value = [getattr(value, axis) for axis in "xyz"]
    array = np.asarray(value, dtype=float).ravel()
    if array.shape != (3,):
        raise MappingError(f"field {path!r} of {message_type} holds {array.size} numbers, expected x, y, z")
    return array


def stamp(message: object) -> int | None:
    """Return the time in a message's header [ns], None if it has none or it was never set."""
    header = getattr(message, "header", None)
    if header is None:
        return None
    time = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
    return time or None


def default_offset(message_type: str, ambient: float = STANDARD_ATMOSPHERE) -> float:
    """Return the offset of gauge pressure [Pa]: FluidPressure is absolute by its definition."""
    return ambient if message_type == FLUID_PRESSURE else 0.0


def at_path(message: object, path: str) -> object:
    """Return the value at a dotted path of a message; MappingError names the missing part."""
    value: object = message
    for name in filter(None, path.split(".")):
        if isinstance(value, (list, tuple)):
            value = [_attribute(item, name, path) for item in value]
        else:
            value = _attribute(value, name, path)
    return value


def _attribute(value: object, name: str, path: str) -> object:
    if not hasattr(value, name):
        raise MappingError(
            f"there is no field {name!r} on the path {path!r}; the message has {_names(value)}"
        )
    return getattr(value, name)


def _names(message: object) -> list[str]:
    return [name for name in getattr(message, "__dataclass_fields__", {}) if not name.startswith("_")]

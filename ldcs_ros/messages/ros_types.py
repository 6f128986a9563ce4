"""The ROS 2 message types of the twin, each with its fields: a tenth of Kilted's types, loaded in a tenth of the time.

`tools/make_message_types.py` writes the table from Kilted's definitions, and a test compares them.
"""

from __future__ import annotations

import ast
import re
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict

# Types that the twin and its bridge use; those nested in them follow.
TYPES = (
    "builtin_interfaces/msg/Duration",
    "diagnostic_msgs/msg/DiagnosticArray",
    "geometry_msgs/msg/PointStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/Vector3Stamped",
    "geometry_msgs/msg/WrenchStamped",
    "nav_msgs/msg/Odometry",
    "rosgraph_msgs/msg/Clock",
    "sensor_msgs/msg/FluidPressure",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/msg/Float64",
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/String",
    "tf2_msgs/msg/TFMessage",
    "visualization_msgs/msg/MarkerArray",
)
_SEQUENCE = re.compile(r"(?P<inner>.*)\[(?P<bound><=)?(?P<count>\d*)\]")


def ros_types() -> Typesdict:
    """Return the fields and constants of each type, as rosbags registers them."""
    types: dict[str, object] = {}
    for entry in re.sub(r"\n +", " ", _TABLE).strip().splitlines():
        name, _, body = entry.partition(": ")
        constants, fields = [], []
        for part in body.split(", "):
            kind, _, field = part.partition(" ")
            field, is_constant, value = field.partition("=")
            if is_constant:
                constants.append((field, kind, ast.literal_eval(value)))
            else:
                fields.append((field, _description(kind)))
        types[name] = constants, fields
    return cast("Typesdict", types)


def _description(kind: str) -> tuple[Nodetype, object]:
    found = _SEQUENCE.fullmatch(kind)
    if found:
        inner, count = _description(found["inner"]), int(found["count"] or 0)
        is_array = bool(found["count"]) and not found["bound"]
        return (Nodetype.ARRAY if is_array else Nodetype.SEQUENCE), (inner, count)
    if "/" in kind:
        return Nodetype.NAME, kind
    base, _, bound = kind.partition("<=")
    return Nodetype.BASE, (base, int(bound or 0))


_TABLE = """
builtin_interfaces/msg/Duration: int32 sec, uint32 nanosec
builtin_interfaces/msg/Time: int32 sec, uint32 nanosec
diagnostic_msgs/msg/DiagnosticArray: std_msgs/msg/Header header, diagnostic_msgs/msg/DiagnosticStatus[] status
diagnostic_msgs/msg/DiagnosticStatus: byte OK=0, byte WARN=1, byte ERROR=2, byte STALE=3, byte level, string name,
    string message, string hardware_id, diagnostic_msgs/msg/KeyValue[] values
diagnostic_msgs/msg/KeyValue: string key, string value
geometry_msgs/msg/Point: float64 x, float64 y, float64 z
geometry_msgs/msg/PointStamped: std_msgs/msg/Header header, geometry_msgs/msg/Point point
geometry_msgs/msg/Pose: geometry_msgs/msg/Point position, geometry_msgs/msg/Quaternion orientation
geometry_msgs/msg/PoseStamped: std_msgs/msg/Header header, geometry_msgs/msg/Pose pose
geometry_msgs/msg/PoseWithCovariance: geometry_msgs/msg/Pose pose, float64[36] covariance
geometry_msgs/msg/PoseWithCovarianceStamped: std_msgs/msg/Header header, geometry_msgs/msg/PoseWithCovariance pose
geometry_msgs/msg/Quaternion: float64 x, float64 y, float64 z, float64 w
geometry_msgs/msg/Transform: geometry_msgs/msg/Vector3 translation, geometry_msgs/msg/Quaternion rotation
geometry_msgs/msg/TransformStamped: std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/Transform
    transform
geometry_msgs/msg/Twist: geometry_msgs/msg/Vector3 linear, geometry_msgs/msg/Vector3 angular
geometry_msgs/msg/TwistWithCovariance: geometry_msgs/msg/Twist twist, float64[36] covariance
geometry_msgs/msg/Vector3: float64 x, float64 y, float64 z
geometry_msgs/msg/Vector3Stamped: std_msgs/msg/Header header, geometry_msgs/msg/Vector3 vector
geometry_msgs/msg/Wrench: geometry_msgs/msg/Vector3 force, geometry_msgs/msg/Vector3 torque
geometry_msgs/msg/WrenchStamped: std_msgs/msg/Header header, geometry_msgs/msg/Wrench wrench
nav_msgs/msg/Odometry: std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/PoseWithCovariance pose,
    geometry_msgs/msg/TwistWithCovariance twist
rosgraph_msgs/msg/Clock: builtin_interfaces/msg/Time clock
sensor_msgs/msg/CompressedImage: std_msgs/msg/Header header, string format, uint8[] data
sensor_msgs/msg/FluidPressure: std_msgs/msg/Header header, float64 fluid_pressure, float64 variance
sensor_msgs/msg/JointState: std_msgs/msg/Header header, string[] name, float64[] position, float64[] velocity,
    float64[] effort
sensor_msgs/msg/PointCloud2: std_msgs/msg/Header header, uint32 height, uint32 width, sensor_msgs/msg/PointField[]
    fields, bool is_bigendian, uint32 point_step, uint32 row_step, uint8[] data, bool is_dense
sensor_msgs/msg/PointField: uint8 INT8=1, uint8 UINT8=2, uint8 INT16=3, uint8 UINT16=4, uint8 INT32=5, uint8
    UINT32=6, uint8 FLOAT32=7, uint8 FLOAT64=8, string name, uint32 offset, uint8 datatype, uint32 count
std_msgs/msg/ColorRGBA: float32 r, float32 g, float32 b, float32 a
std_msgs/msg/Float64: float64 data
std_msgs/msg/Float64MultiArray: std_msgs/msg/MultiArrayLayout layout, float64[] data
std_msgs/msg/Header: builtin_interfaces/msg/Time stamp, string frame_id
std_msgs/msg/MultiArrayDimension: string label, uint32 size, uint32 stride
std_msgs/msg/MultiArrayLayout: std_msgs/msg/MultiArrayDimension[] dim, uint32 data_offset
std_msgs/msg/String: string data
tf2_msgs/msg/TFMessage: geometry_msgs/msg/TransformStamped[] transforms
visualization_msgs/msg/Marker: int32 ARROW=0, int32 CUBE=1, int32 SPHERE=2, int32 CYLINDER=3, int32 LINE_STRIP=4,
    int32 LINE_LIST=5, int32 CUBE_LIST=6, int32 SPHERE_LIST=7, int32 POINTS=8, int32 TEXT_VIEW_FACING=9, int32
    MESH_RESOURCE=10, int32 TRIANGLE_LIST=11, int32 ARROW_STRIP=12, int32 ADD=0, int32 MODIFY=0, int32 DELETE=2,
    int32 DELETEALL=3, std_msgs/msg/Header header, string ns, int32 id, int32 type, int32 action,
    geometry_msgs/msg/Pose pose, geometry_msgs/msg/Vector3 scale, std_msgs/msg/ColorRGBA color,
    builtin_interfaces/msg/Duration lifetime, bool frame_locked, geometry_msgs/msg/Point[] points,
    std_msgs/msg/ColorRGBA[] colors, string texture_resource, sensor_msgs/msg/CompressedImage texture,
    visualization_msgs/msg/UVCoordinate[] uv_coordinates, string text, string mesh_resource,
    visualization_msgs/msg/MeshFile mesh_file, bool mesh_use_embedded_materials
visualization_msgs/msg/MarkerArray: visualization_msgs/msg/Marker[] markers
visualization_msgs/msg/MeshFile: string filename, uint8[] data
visualization_msgs/msg/UVCoordinate: float32 u, float32 v
"""

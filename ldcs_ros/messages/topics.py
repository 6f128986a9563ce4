"""Every topic of the twin as data: name, ROS type, direction and quality of service."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

BASE_FRAME = "ldcs_base"
TRACKER_FRAME = "trakstar_base"


@dataclass(frozen=True)
class Topic:
    """One topic.

    Attributes:
        name: Name, relative unless it starts with '/'; '{point}' and '{arm}' are placeholders for each of them.
        type: ROS message type.
        direction: 'in' for commands, 'out' for what the twin reports.
        meaning: Its content, with units.
        reliable: Reliable delivery; else best effort.
        transient_local: The last messages are kept for those who come late.
        depth: Length of the queue.
        keep_all: The queue is as long as the middleware allows instead.
        on_demand: Built only while the topic has subscribers.
        recorded: Put into bags.
        measured: Performance of the computer, which no replay repeats.
    """

    name: str
    type: str
    direction: str
    meaning: str
    reliable: bool = True
    transient_local: bool = False
    depth: int = 10
    keep_all: bool = False
    on_demand: bool = False
    recorded: bool = True
    measured: bool = False


# A second of commands at 1 kHz: none is overwritten while a service is being served or a bag closed.
_COMMANDS = 1000

_ALL = (
    Topic(
        "pressure_command",
        "std_msgs/msg/Float64MultiArray",
        "in",
        "gauge pressure of each arm [Pa] in the scene's order (left, right); one value for all",
        depth=_COMMANDS,
    ),
    Topic(
        "torque_command",
        "sensor_msgs/msg/JointState",
        "in",
        "joint torques [N m] in effort, by joint name",
        depth=_COMMANDS,
    ),
    # It amounts to pressures or torques and is recorded as those: commands in bags have standard types.
    Topic(
        "arm_command",
        "ldcs_msgs/msg/ArmCommand",
        "in",
        "stamped, numbered: gauge pressures [Pa] or torques [N m] by the name of the arm",
        depth=_COMMANDS,
        recorded=False,
    ),
    Topic(
        "external_wrench",
        "geometry_msgs/msg/WrenchStamped",
        "in",
        "force [N] and torque [N m] at the point named by frame_id, held until replaced or timed out",
        depth=_COMMANDS,
    ),
    Topic(
        "nodes",
        "sensor_msgs/msg/PointCloud2",
        "out",
        "all nodes, height 2 n (layer, i), width n (j): x y z [m], vx vy vz [m/s], float32",
    ),
    Topic(
        "{point}/pose",
        "geometry_msgs/msg/PoseStamped",
        "out",
        "pose that the tracker reports, stamped when measured",
    ),
    Topic(
        "trakstar_msg",
        "geometry_msgs/msg/TransformStamped",
        "out",
        "the tracker as its ROS 2 driver publishes it: one message a probe, stamped when delivered",
    ),
    Topic(
        "trakstar_raw_msg",
        "geometry_msgs/msg/TransformStamped",
        "out",
        "the same in the transmitter's own axes (x and z reversed)",
    ),
    Topic("truth/{point}/pose", "geometry_msgs/msg/PoseStamped", "out", "noise-free pose of the point"),
    Topic(
        "joint_states",
        "sensor_msgs/msg/JointState",
        "out",
        "arm joints: angle [rad], rate [rad/s], drive torque [N m]",
    ),
    Topic(
        "{arm}/pressure",
        "sensor_msgs/msg/FluidPressure",
        "out",
        "measured pressure [Pa], absolute as the type defines",
    ),
    # Markers are for viewers, who can draw them from `nodes`; they would fill most of a bag.
    Topic(
        "surface",
        "visualization_msgs/msg/Marker",
        "out",
        "triangle mesh of the sheet, coloured by height",
        on_demand=True,
        recorded=False,
    ),
    Topic(
        "loads",
        "visualization_msgs/msg/MarkerArray",
        "out",
        "loads on the sheet: arrows of forces and torques, payloads, each with its size",
        on_demand=True,
        recorded=False,
    ),
    Topic(
        "arms",
        "visualization_msgs/msg/MarkerArray",
        "out",
        "the arms' links and joints, and driven edges",
        on_demand=True,
        recorded=False,
    ),
    Topic(
        "traces",
        "visualization_msgs/msg/MarkerArray",
        "out",
        "the ways that the named points went",
        on_demand=True,
        recorded=False,
    ),
    # Our own types, and a bag three times as large: these two are recorded only on request.
    Topic(
        "lattice_state",
        "ldcs_msgs/msg/LatticeState",
        "out",
        "the whole state in full precision, float64: nodes [m, m/s], links [rad, rad/s], chambers [Pa]",
        on_demand=True,
        recorded=False,
    ),
    Topic(
        "solver_status",
        "ldcs_msgs/msg/SolverStatus",
        "out",
        "real-time factor, step [s], estimated error [m], counters at 10 Hz",
        on_demand=True,
        recorded=False,
        measured=True,
    ),
    Topic(
        "/diagnostics",
        "diagnostic_msgs/msg/DiagnosticArray",
        "out",
        "health of the twin at 1 Hz",
        measured=True,
    ),
    Topic("/clock", "rosgraph_msgs/msg/Clock", "out", "simulation time", depth=1),
    Topic("/tf", "tf2_msgs/msg/TFMessage", "out", "points and links of the arms in ldcs_base", depth=100),
    Topic(
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        "out",
        "trakstar_base in ldcs_base",
        transient_local=True,
        depth=1,
    ),
    Topic(
        "robot_description",
        "std_msgs/msg/String",
        "out",
        "URDF of the arms, for the display RobotModel of RViz; with /tf",
        transient_local=True,
        depth=1,
        recorded=False,
    ),
)

TOPICS: dict[str, Topic] = {topic.name: topic for topic in _ALL}


def expand(name: str, names: Iterable[str]) -> dict[str, Topic]:
    """Return the topics of a pattern such as '{point}/pose', by their names."""
    pattern = TOPICS[name]
    filled = (name.format(point=one, arm=one) for one in names)
    return {one: replace(pattern, name=one) for one in filled}

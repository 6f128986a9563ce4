"""The parameters of the bridge and of the mock rig as data."""

from __future__ import annotations

from ldcs_ros.integrators.settings import Solver
from ldcs_ros.mock_rig.faults import Faults
from ldcs_ros.mock_rig.rig import CONTROLLERS, Hidden
from ldcs_ros.ros.common.parameters import NodeParameter, bounds_of

TRANSPORTS = ("topics", "modbus", "serial")

_BRIDGE = (
    NodeParameter("rig", "", "Rig file: the path of one, or the name of a shipped one; must be given."),
    NodeParameter(
        "scene",
        "rig",
        "Scene of the twin: the name of a shipped one, or a path; its arms have drive: pressure.",
    ),
    NodeParameter(
        "mode",
        "shadow",
        "shadow: listen only; mirror: pull an estimate to the sensors; live: forward commands; "
        "vent: ramp the set-points to zero, wait until the rig confirms it, and end.",
    ),
    NodeParameter(
        "record", "", "Folder for the bags <record>/twin and <record>/rig; it must not exist. Empty for none."
    ),
    NodeParameter("publish_rate", 50.0, "Reports of the twin's state per second [Hz].", 0.1, 2000.0),
    NodeParameter(
        "accuracy",
        1e-4,
        "Largest node position error asked of the solver [m].",
        *bounds_of(Solver, "accuracy"),
    ),
    NodeParameter("duration", 0.0, "Time after which the bridge ends [s]; 0 for never.", 0.0, 1e9),
)

_FAULTS = Faults()
_MOCK_RIG = (
    NodeParameter("scene", "rig", "Scene of the rig without its hidden parameters."),
    NodeParameter(
        "transport", "topics", f"Transport of pressures and set-points: one of {', '.join(TRANSPORTS)}."
    ),
    NodeParameter("controller", "wave", f"Source of set-points: one of {', '.join(CONTROLLERS)}."),
    NodeParameter("port", 0, "TCP port of the Modbus server; 0 for any free one.", 0, 65535),
    NodeParameter(
        "rig_file", "", "File into which the rig file that connects a bridge is written; empty to print it."
    ),
    NodeParameter(
        "stiffness_factor", Hidden.stiffness, "Factor on the stiffness of the sheet's springs.", 0.1, 10.0
    ),
    NodeParameter("gain_factor", Hidden.gain, "Factor on the arms' torque for a pressure.", 0.1, 10.0),
    NodeParameter("load", Hidden.load, "Mass at the free edge beside the scene's payload [kg].", 0.0, 1.0),
    NodeParameter(
        "tracker_delay",
        Hidden.tracker_delay,
        "Time from a measurement of the tracker to its delivery [s].",
        0.0,
        1.0,
    ),
    NodeParameter("clock_epoch", 1000.0, "Reading of the rig's clock at its start [s].", 0.0, 1e9),
    NodeParameter("fault_mute", _FAULTS.mute, "It reports nothing more, but still obeys.", read_only=False),
    NodeParameter(
        "fault_delay", _FAULTS.delay, "Its reports come this much later [s].", 0.0, 60.0, read_only=False
    ),
    NodeParameter(
        "fault_stuck",
        _FAULTS.stuck,
        "Arm whose valve stays as it is; empty for none.",
        read_only=False,
    ),
    NodeParameter("fault_leak", _FAULTS.leak, "Arm that loses air; empty for none.", read_only=False),
    NodeParameter(
        "fault_duplicates",
        _FAULTS.duplicates,
        "Every report is sent this many times more.",
        0,
        1000,
        read_only=False,
    ),
    NodeParameter(
        "fault_clock_jump",
        _FAULTS.clock_jump,
        "Its clock is off by this much more [s].",
        -1e6,
        1e6,
        read_only=False,
    ),
    NodeParameter(
        "fault_nan",
        _FAULTS.nan,
        "Arm whose pressure sensor reports invalid values; empty for none.",
        read_only=False,
    ),
    NodeParameter("fault_drop", _FAULTS.drop, "The connection is gone.", read_only=False),
)

BRIDGE_PARAMETERS: dict[str, NodeParameter] = {parameter.name: parameter for parameter in _BRIDGE}
MOCK_RIG_PARAMETERS: dict[str, NodeParameter] = {parameter.name: parameter for parameter in _MOCK_RIG}

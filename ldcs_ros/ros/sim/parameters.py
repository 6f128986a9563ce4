"""The parameters of the simulation node."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from ldcs_ros.integrators.settings import Solver
from ldcs_ros.ros.common.parameters import NodeParameter, bounds_of, validation_error
from ldcs_ros.sensors import TrackerParameters

if TYPE_CHECKING:
    from rclpy.parameter import AllowableParameterValue

_at_configure = partial(NodeParameter, read_only=False, at_configure=True)

_ALL = (
    _at_configure("scene", "paper", "Scene: the name of a shipped one, or the path of a scene file."),
    NodeParameter(
        "real_time_factor",
        1.0,
        "Simulated seconds per second of wall time; -1 for as fast as possible.",
        1e-3,
        1000.0,
        off=-1.0,
        read_only=False,
    ),
    NodeParameter(
        "duration", 0.0, "Simulation time at which the node ends [s]; 0 for never.", 0.0, 1e9, read_only=False
    ),
    _at_configure("record", "", "Folder of the bag that is recorded; it must not exist. Empty for none."),
    NodeParameter(
        "graph_folder",
        "",
        "Folder below which files lie that are named over the graph: by load_scene, LoadWorld, and by scene and "
        "record when they are set later. Empty for no files.",
    ),
    _at_configure("seed", -1, "Seed of the sensors' noise; -1 for the scene's own.", -1, 2**31 - 1),
    _at_configure(
        "publish_rate", 50.0, "Reports of the state per second of simulation time [Hz].", 0.1, 2000.0
    ),
    _at_configure(
        "tracker_rate",
        0.0,
        "Measurements of the tracker per second [Hz]; 0 for the scene's own.",
        *bounds_of(TrackerParameters, "rate"),
        off=0.0,
    ),
    NodeParameter(
        "command_timeout",
        0.0,
        "Silence of the arms' commands after which they are vented [s of steady clock]; 0 for never.",
        0.0,
        3600.0,
        read_only=False,
    ),
    NodeParameter(
        "wrench_timeout",
        0.0,
        "Time that an external wrench is held [s of steady clock]; 0 for until replaced.",
        0.0,
        3600.0,
        read_only=False,
    ),
    _at_configure("publish_clock", False, "Publish simulation time on /clock."),
    _at_configure("publish_tf", False, "Publish the points on /tf, where tf2_msgs is installed."),
    _at_configure(
        "frame_prefix",
        "",
        "Prefix of the name of each frame, such as 'twin1/'; one tf tree holds many twins.",
    ),
    _at_configure(
        "record_detail",
        False,
        "Record lattice_state and solver_status too: the state in full precision, a bag three times as large.",
    ),
    _at_configure(
        "accuracy",
        0.0,
        "Largest node position error asked of the solver [m]; 0 for the scene's own.",
        *bounds_of(Solver, "accuracy"),
        off=0.0,
    ),
    _at_configure(
        "verify",
        False,
        "Measure the error by a second solution at a tenth of the accuracy, for solver_status and bags.",
    ),
    _at_configure(
        "ambient_pressure", 101325.0, "Absolute pressure of the air, added to gauge pressures [Pa].", 0.0, 2e5
    ),
    NodeParameter("autostart", True, "Configure and activate the node at its start."),
)

PARAMETERS: dict[str, NodeParameter] = {parameter.name: parameter for parameter in _ALL}


def check(changes: list[Parameter[AllowableParameterValue]], *, configured: bool) -> SetParametersResult:
    """Accept or refuse a set of values of the simulation node as a whole.

    Args:
        changes: The values.
        configured: Whether the node has taken its values; a clean-up releases them.
    """
    late = [one.name for one in changes if one.name in PARAMETERS and PARAMETERS[one.name].at_configure]
    reason = validation_error(changes, PARAMETERS)
    if configured and late:
        reason = f"parameter {late[0]} is taken when the node is configured; deactivate and clean up first"
    return SetParametersResult(successful=not reason, reason=reason)

"""A node's parameters as data: default, meaning, range, whether they may change; and those of the simulation node."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ldcs_ros.schema.fields import did_you_mean


@dataclass(frozen=True)
class NodeParameter:
    """One parameter.

    Attributes:
        name: Its name.
        default: Its default, which also gives its type.
        description: What it means, with unit.
        low: Smallest accepted number; None for no range.
        high: Largest accepted number.
        read_only: Fixed from the start of the node.
        at_configure: Taken when the node is configured: may change while it is unconfigured.
        note: What the range leaves out.
    """

    name: str
    default: Any
    description: str
    low: float | None = None
    high: float | None = None
    read_only: bool = True
    at_configure: bool = False
    note: str = ""


_at_configure = partial(NodeParameter, read_only=False, at_configure=True)

_ALL = (
    _at_configure("scene", "paper", "Scene: the name of a shipped one, or the path of a scene file."),
    NodeParameter(
        "real_time_factor",
        1.0,
        "Simulated seconds a second of wall time; -1 for as fast as possible.",
        -1.0,
        1000.0,
        read_only=False,
        note="-1, or 0.001 and more",
    ),
    NodeParameter(
        "duration", 0.0, "Simulation time at which the node ends [s]; 0 for never.", 0.0, 1e9, read_only=False
    ),
    _at_configure("record", "", "Folder of the bag that is recorded; it must not exist. Empty for none."),
    _at_configure("seed", -1, "Seed of the sensors' noise; -1 for the scene's own.", -1, 2**31 - 1),
    _at_configure(
        "publish_rate", 50.0, "Reports of the state a second of simulation time [Hz].", 0.1, 2000.0
    ),
    _at_configure(
        "tracker_rate",
        0.0,
        "Measurements of the tracker a second [Hz], 0.1 and more; 0 for the scene's own.",
        0.0,
        2000.0,
        note="0, or 0.1 and more",
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
        "What stands before the name of each frame, such as 'twin1/'; one tf tree holds many twins.",
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
        0.0,
        1e-2,
        note="0, or 1e-9 and more",
    ),
    _at_configure(
        "ambient_pressure", 101325.0, "Absolute pressure of the air, added to gauge pressures [Pa].", 0.0, 2e5
    ),
    NodeParameter("autostart", True, "Configure and activate the node at its start."),
)

PARAMETERS: dict[str, NodeParameter] = {parameter.name: parameter for parameter in _ALL}

_ROS_PARAMETERS = ("qos_overrides.", "use_sim_time", "start_type_description_service")

# Values between the word that switches something off and the smallest that makes sense.
_GAPS = {"real_time_factor": (-1.0, 1e-3), "tracker_rate": (0.0, 0.1), "accuracy": (0.0, 1e-9)}


def declare(node: Node, table: Mapping[str, NodeParameter] = PARAMETERS) -> list[str]:
    """Declare a table of parameters on a node; return a complaint about each given name that is none of them.

    Raises:
        ParameterException or ValueError: A value given at the start is of a wrong type or out of its range.
    """
    for parameter in table.values():
        node.declare_parameter(parameter.name, parameter.default, _descriptor(parameter))
    given = [node.get_parameter(name) for name in table]
    reason = complaint(given, table)
    if reason:
        raise ValueError(reason)
    # ROS ignores what is not declared, so that one file can serve many nodes; a slip should not pass in silence.
    return [
        f"unknown parameter '{name}' is ignored.{did_you_mean(name, table)}"
        for name in node._parameter_overrides
        if name not in table and not name.startswith(_ROS_PARAMETERS)
    ]


def complaint(changes: Iterable[Parameter[Any]], table: Mapping[str, NodeParameter] = PARAMETERS) -> str:
    """Return what is wrong with a set of values beyond type and range; '' when nothing is."""
    for change in changes:
        parameter = table.get(change.name)
        if parameter is None or not isinstance(change.value, float):
            continue
        low, high = _GAPS.get(change.name, (0.0, 0.0))
        if not math.isfinite(change.value) or low < change.value < high:
            expected = parameter.note or f"{parameter.low:g} ... {parameter.high:g}"
            return (
                f"parameter {change.name} is {change.value:g}, expected {expected}: {parameter.description}"
            )
    return ""


def check(changes: list[Parameter[Any]], *, configured: bool) -> SetParametersResult:
    """Accept or refuse a set of values of the simulation node as a whole.

    Args:
        changes: The values.
        configured: The node has taken its values, and lets them go only when it is cleaned up.
    """
    late = [one.name for one in changes if one.name in PARAMETERS and PARAMETERS[one.name].at_configure]
    reason = complaint(changes)
    if configured and late:
        reason = f"parameter {late[0]} is taken when the node is configured; deactivate and clean up first"
    return SetParametersResult(successful=not reason, reason=reason)


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    taken = "taken when the node is configured" if parameter.at_configure else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.description,
        read_only=parameter.read_only,
        additional_constraints="; ".join(filter(None, [parameter.note, taken])),
    )
    if parameter.low is not None and parameter.high is not None:
        if isinstance(parameter.default, float):
            bounds = FloatingPointRange(from_value=float(parameter.low), to_value=float(parameter.high))
            descriptor.floating_point_range = [bounds]
        else:
            whole = IntegerRange(from_value=int(parameter.low), to_value=int(parameter.high), step=1)
            descriptor.integer_range = [whole]
    return descriptor

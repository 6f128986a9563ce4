"""Parameters of a node as data, and services that set them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

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


_ROS_PARAMETERS = ("qos_overrides.", "use_sim_time", "start_type_description_service")

# Values between the word that switches something off and the smallest that makes sense.
_GAPS = {"real_time_factor": (-1.0, 1e-3), "tracker_rate": (0.0, 0.1), "accuracy": (0.0, 1e-9)}


def declare(node: Node, table: Mapping[str, NodeParameter]) -> list[str]:
    """Declare a table of parameters on a node; return a complaint about each given name that is none of them.

    Raises:
        ParameterException or ValueError: A value given at the start is of a wrong type or out of its range.
    """
    for parameter in table.values():
        node.declare_parameter(parameter.name, parameter.default, _descriptor(parameter))
    given = [node.get_parameter(name) for name in table]
    reason = validation_error(given, table)
    if reason:
        raise ValueError(reason)
    # ROS ignores what is not declared, so that one file can serve many nodes; a slip should not pass in silence.
    return [
        f"unknown parameter '{name}' is ignored.{did_you_mean(name, table)}"
        for name in node._parameter_overrides
        if name not in table and not name.startswith(_ROS_PARAMETERS)
    ]


def validation_error(changes: Iterable[Parameter[Any]], table: Mapping[str, NodeParameter]) -> str:
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


class OwnParameterService(ParameterService):
    """rclpy's parameter services; a value that a parameter has already is accepted, also where it cannot change.

    `set_parameters` answers value by value, `set_parameters_atomically` takes all or none. So `ros2 param load` takes
    what `ros2 param dump` wrote. A request may hold a type that does not exist; rclpy would end the process with it.
    """

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        response.results = [self._set([one]) for one in request.parameters]
        return response

    def _set_parameters_atomically_callback(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: Iterable[ParameterMessage]) -> SetParametersResult:
        try:
            node = self._get_node()
            changes = [
                change
                for change in map(Parameter.from_parameter_msg, messages)
                if not _is_unchanged(node, change)
            ]
            if not changes:
                return SetParametersResult(successful=True)
            return node.set_parameters_atomically(changes)
        except (ParameterNotDeclaredException, ValueError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))


def _is_unchanged(node: Node, change: Parameter[Any]) -> bool:
    if not node.has_parameter(change.name):
        return False
    present = node.get_parameter(change.name)
    return present.type_ == change.type_ and present.value == change.value

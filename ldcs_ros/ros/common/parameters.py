"""Parameters of a node as a table, and services that set them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from ldcs_ros.schema.fields import did_you_mean

if TYPE_CHECKING:
    from rclpy.parameter import AllowableParameterValue


@dataclass(frozen=True)
class NodeParameter:
    """One parameter.

    Attributes:
        name: Its name.
        default: Its default, which also gives its type.
        description: Its meaning, with unit.
        low: Smallest accepted number; None for no range.
        high: Largest accepted number.
        off: Number below `low` that switches the parameter off; None for none.
        read_only: Fixed from the start of the node.
        at_configure: Taken when the node is configured: may change while it is unconfigured.
    """

    name: str
    default: bool | int | float | str
    description: str
    low: float | None = None
    high: float | None = None
    off: float | None = None
    read_only: bool = True
    at_configure: bool = False

    @property
    def accepted(self) -> str:
        """The accepted numbers in words; '' for no range."""
        if self.low is None or self.high is None:
            return ""
        text = f"{_number(self.low)} ... {_number(self.high)}"
        return text if self.off is None else f"{_number(self.off)}, or {text}"


def bounds_of(cls: type, name: str) -> tuple[float, float]:
    """Return the bounds that a dataclass declares for one of its fields."""
    meta = next(field.metadata for field in dataclasses.fields(cls) if field.name == name)
    return meta["low"], meta["high"]


_ROS_PARAMETERS = ("qos_overrides.", "use_sim_time", "start_type_description_service")


class ParameterNode(Node):
    """A node with a table of parameters and the services that set them."""

    def declare_table(self, table: Mapping[str, NodeParameter]) -> None:
        """Declare a table of parameters, warn of given names that it lacks, and offer the parameter services.

        Raises:
            ParameterException or ValueError: A value given at the start is of a wrong type or out of its range.
        """
        for parameter in table.values():
            given = self._parameter_overrides.get(parameter.name)
            if given is not None and isinstance(parameter.default, float):
                self._parameter_overrides[parameter.name] = _as_float(given)
            self.declare_parameter(parameter.name, parameter.default, _descriptor(parameter))
        reason = validation_error([self.get_parameter(name) for name in table], table)
        if reason:
            raise ValueError(reason)
        # ROS ignores unknown names, so that one file can serve many nodes; a slip should not pass in silence.
        for name in self.given_parameters():
            if name not in table and not name.startswith(_ROS_PARAMETERS):
                hint = did_you_mean(name, table)
                self.get_logger().warning(f"unknown parameter '{name}' is ignored.{hint}")
        self._parameter_services = OwnParameterService(self)

    def given_parameters(self) -> dict[str, AllowableParameterValue]:
        """Return the parameters that were given at the start of the node, also those that are not declared."""
        return {name: parameter.value for name, parameter in self._parameter_overrides.items()}

    def value(self, name: str) -> Any:  # of the type of the parameter's default
        """Return the present value of a parameter."""
        return self.get_parameter(name).value


def validation_error(
    changes: Iterable[Parameter[AllowableParameterValue]], table: Mapping[str, NodeParameter]
) -> str:
    """Return the first error in a set of values beyond type and range; '' for none."""
    for change in changes:
        parameter, value = table.get(change.name), change.value
        if parameter is None or not isinstance(value, float):
            continue
        valid = math.isfinite(value) and (parameter.low is None or parameter.low <= value)
        if not valid and value != parameter.off:
            return f"parameter {change.name} is {value:g}, expected {parameter.accepted}: {parameter.description}"
    return ""


def _number(value: float) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    taken = "taken when the node is configured" if parameter.at_configure else ""
    gap = parameter.accepted if parameter.off is not None else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.description,
        read_only=parameter.read_only,
        additional_constraints="; ".join(filter(None, [gap, taken])),
    )
    if parameter.low is not None and parameter.high is not None:
        low = parameter.low if parameter.off is None else parameter.off
        if isinstance(parameter.default, float):
            bounds = FloatingPointRange(from_value=float(low), to_value=float(parameter.high))
            descriptor.floating_point_range = [bounds]
        else:
            whole = IntegerRange(from_value=int(low), to_value=int(parameter.high), step=1)
            descriptor.integer_range = [whole]
    return descriptor


class OwnParameterService(ParameterService):
    """rclpy's parameter services; a value that a parameter has already is accepted, also where it cannot change.

    `set_parameters` answers value by value, `set_parameters_atomically` takes all or none. So `ros2 param load` takes
    the file of `ros2 param dump`. A request may hold a type that does not exist; rclpy would end the process with it.
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
                for change in (_as_declared(node, Parameter.from_parameter_msg(one)) for one in messages)
                if not _is_unchanged(node, change)
            ]
            if not changes:
                return SetParametersResult(successful=True)
            return node.set_parameters_atomically(changes)
        except (ParameterNotDeclaredException, ValueError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))


def _as_float(given: Parameter[AllowableParameterValue]) -> Parameter[AllowableParameterValue]:
    """Return a whole number as a floating-point one; people write -1 for -1.0."""
    value = given.value
    if given.type_ is not Parameter.Type.INTEGER or not isinstance(value, int):
        return given
    return Parameter(given.name, Parameter.Type.DOUBLE, float(value))


def _as_declared(
    node: Node, change: Parameter[AllowableParameterValue]
) -> Parameter[AllowableParameterValue]:
    if not node.has_parameter(change.name):
        return change
    return _as_float(change) if node.get_parameter(change.name).type_ is Parameter.Type.DOUBLE else change


def _is_unchanged(node: Node, change: Parameter[AllowableParameterValue]) -> bool:
    if not node.has_parameter(change.name):
        return False
    present = node.get_parameter(change.name)
    return present.type_ == change.type_ and present.value == change.value

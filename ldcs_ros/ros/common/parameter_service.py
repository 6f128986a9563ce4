"""Parameter services that take or refuse a request as a whole, and refuse what makes no sense instead of failing."""

from __future__ import annotations

from collections.abc import Iterable

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService


class WholeParameterService(ParameterService):
    """rclpy's parameter services, except that one bad value in a list keeps all of them from being set.

    A request may hold anything, such as a type that does not exist; rclpy would end the process with it.
    """

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        response.results = [self._set(request.parameters)] * len(request.parameters)
        return response

    def _set_parameters_atomically_callback(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: Iterable[ParameterMessage]) -> SetParametersResult:
        try:
            changes = [Parameter.from_parameter_msg(one) for one in messages]
            return self._get_node().set_parameters_atomically(changes)
        except (ParameterNotDeclaredException, ValueError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))

"""Parameter services that take or refuse a request as a whole, also the plain `set_parameters`."""

from __future__ import annotations

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService


class WholeParameterService(ParameterService):
    """rclpy's parameter services, except that one bad value in a list keeps all of them from being set."""

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        changes = [Parameter.from_parameter_msg(one) for one in request.parameters]
        try:
            result = self._get_node().set_parameters_atomically(changes)
        except ParameterNotDeclaredException as error:
            result = SetParametersResult(successful=False, reason=str(error))
        response.results = [result] * len(changes)
        return response

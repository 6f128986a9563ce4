"""The live twin: `ros2 launch ldcs_ros sim.launch.py scene:=rig real_time_factor:=2.0 namespace:=/left`."""

from __future__ import annotations

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration

from ldcs_ros.ros.common.launching import NAMESPACE, argument, given_parameters, node, parameter_arguments
from ldcs_ros.ros.sim.parameters import PARAMETERS


def generate_launch_description() -> LaunchDescription:
    """One node; each of its parameters is an argument."""
    return LaunchDescription(
        [
            argument("namespace", NAMESPACE, "Namespace of the twin."),
            argument(
                "params_file", "", "Parameter file (YAML), such as config/sim.yaml; arguments come before it."
            ),
            *parameter_arguments(PARAMETERS.values()),
            OpaqueFunction(function=_twin),
        ]
    )


def _twin(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    values = given_parameters(context, PARAMETERS.values())
    return [node(context, "sim", values, file="params_file", namespace=LaunchConfiguration("namespace"))]

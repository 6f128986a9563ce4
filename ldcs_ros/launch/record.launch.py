"""The live twin, recorded: `ros2 launch ldcs_ros record.launch.py scene:=rig record:=out/rig graph:=out/rig_graph`."""

from __future__ import annotations

import time

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration

from ldcs_ros.ros.common.launching import (
    NAMESPACE,
    argument,
    given_parameters,
    node,
    parameter_arguments,
    process,
)
from ldcs_ros.ros.sim.parameters import PARAMETERS


def generate_launch_description() -> LaunchDescription:
    """Return a launch in which the twin records itself; `graph` adds rosbag2 for topics of other nodes."""
    defaults = {"record": time.strftime("out/%Y%m%d-%H%M%S")}
    return LaunchDescription(
        [
            argument("namespace", NAMESPACE, "Namespace of the twin."),
            argument(
                "params_file", "", "Parameter file (YAML), such as config/sim.yaml; arguments come before it."
            ),
            argument(
                "graph",
                "",
                "Folder of a second bag, by rosbag2, of every topic in the graph; empty for none.",
            ),
            *parameter_arguments(PARAMETERS.values(), defaults),
            OpaqueFunction(function=_twin_and_recorder),
        ]
    )


def _twin_and_recorder(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    values = given_parameters(context, PARAMETERS.values())
    twin = node(context, "sim", values, file="params_file", namespace=LaunchConfiguration("namespace"))
    folder = context.launch_configurations["graph"]
    if not folder:
        return [twin]
    command = ["ros2", "bag", "record", "--all", "--storage", "mcap", "--output", folder]
    return [process(command), twin]

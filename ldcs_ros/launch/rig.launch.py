"""A rig or the mock rig, and the twin beside it: `ros2 launch ldcs_ros rig.launch.py mode:=mirror`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.events.process import ProcessIO
from launch_ros.actions import Node

from ldcs_ros.ros.common.launching import (
    NAMESPACE,
    argument,
    file_parameters,
    given_parameters,
    node,
    parameter_arguments,
)
from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS

BRIDGE_NAME = "ldcs_bridge"
# Both nodes have a scene: the rig's is the twin's, with something hidden in it.
RIG = [one for one in MOCK_RIG_PARAMETERS.values() if one.name not in ("scene", "rig_file")]


def generate_launch_description() -> LaunchDescription:
    """Return the bridge on the rig that the argument or the parameter file names; without one, a mock rig and it."""
    return LaunchDescription(
        [
            argument("namespace", NAMESPACE, "Namespace of the bridge and the twin in it."),
            argument("params_file", "", "Parameter file of the bridge, such as config/bridge.yaml."),
            argument("rig_params_file", "", "Parameter file of the mock rig, such as config/mock_rig.yaml."),
            *parameter_arguments(BRIDGE_PARAMETERS.values()),
            *parameter_arguments(RIG),
            OpaqueFunction(function=_rig_and_bridge),
        ]
    )


def _rig_and_bridge(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    given = context.launch_configurations
    values = given_parameters(context, BRIDGE_PARAMETERS.values())
    name = f"/{given['namespace'].strip('/')}/{BRIDGE_NAME}"
    from_file = file_parameters(context, "params_file", name)

    def setting(key: str) -> str:
        return str(given[key] or from_file.get(key) or "")

    if setting("rig"):
        return [_bridge(context, values)]
    rig_file = Path(tempfile.mkdtemp(prefix="ldcs_rig_"), "rig.yaml")
    rig_values = given_parameters(context, RIG)
    if setting("mode") == "live" and not given["controller"]:
        rig_values["controller"] = "remote"
    if setting("scene"):
        rig_values["scene"] = setting("scene")
    rig = node(context, "mock_rig", {**rig_values, "rig_file": str(rig_file)}, file="rig_params_file")
    bridges = [_bridge(context, {**values, "rig": str(rig_file)})]

    def connect(_: ProcessIO) -> Node | None:
        # The rig writes its file when its port is open, and then says something at least every other second.
        return bridges.pop() if bridges and rig_file.exists() else None

    return [rig, RegisterEventHandler(OnProcessIO(target_action=rig, on_stdout=connect, on_stderr=connect))]


def _bridge(context: LaunchContext, values: dict[str, Any]) -> Node:
    return node(
        context, "bridge", values, file="params_file", namespace=context.launch_configurations["namespace"]
    )

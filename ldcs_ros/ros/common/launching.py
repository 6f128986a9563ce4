"""Parts of the launch files: a node's parameters as launch arguments, and the node with those that were given."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from launch import LaunchContext, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, ExecuteProcess, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from ldcs_ros.ros.common.parameters import NodeParameter

if TYPE_CHECKING:
    from launch.some_substitutions_type import SomeSubstitutionsType

PACKAGE = "ldcs_ros"
NAMESPACE = "/ldcs"


def argument(name: str, default: SomeSubstitutionsType, meaning: str) -> DeclareLaunchArgument:
    """Return an argument with its default and meaning, as `ros2 launch --show-args` prints them."""
    return DeclareLaunchArgument(name, default_value=default, description=meaning)


def parameter_arguments(
    parameters: Iterable[NodeParameter], defaults: Mapping[str, str] | None = None
) -> list[DeclareLaunchArgument]:
    """Return an argument for each parameter; left empty, the parameter file decides, or else the node.

    Args:
        parameters: Parameters of a node.
        defaults: Other defaults than empty, by name.
    """
    given = defaults or {}
    return [
        argument(
            parameter.name,
            given.get(parameter.name, ""),
            f"{parameter.description} Left empty: that of the parameter file, or {_shown(parameter.default)}.",
        )
        for parameter in parameters
    ]


def given_parameters(context: LaunchContext, parameters: Iterable[NodeParameter]) -> dict[str, Any]:
    """Return the parameters whose arguments are not empty, each with its own type."""
    return {
        parameter.name: ParameterValue(
            LaunchConfiguration(parameter.name), value_type=type(parameter.default)
        )
        for parameter in parameters
        if context.launch_configurations.get(parameter.name)
    }


def file_parameters(context: LaunchContext, file: str, node_name: str) -> dict[str, Any]:
    """Return the parameters that a parameter file gives to a node; later sections override earlier ones.

    Args:
        context: The launch under way.
        file: Argument that holds the path of the file; an empty path has no parameters.
        node_name: Name of the node with its namespace, such as '/ldcs/ldcs_bridge'.

    Raises:
        RuntimeError: The file cannot be read.
    """
    path = context.launch_configurations.get(file, "")
    if not path:
        return {}
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RuntimeError(f"cannot read {file} {path}: {' '.join(str(error).split())}") from error
    values: dict[str, Any] = {}
    for pattern, parameters in _sections(content, ""):
        if re.fullmatch(pattern, node_name):
            values |= parameters
    return values


def _sections(content: object, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a pattern of node names and the parameters of each section."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == "ros__parameters" and isinstance(value, dict):
            # As in ROS: * is one name, ** any number of them.
            parts = [
                {"**": "(/[^/]+)*", "*": "/[^/]+"}.get(part, f"/{re.escape(part)}")
                for part in name.split("/")
                if part
            ]
            yield "".join(parts), value
        else:
            yield from _sections(value, f"{name}/{key}")


def node(
    context: LaunchContext,
    executable: str,
    values: Mapping[str, object],
    *,
    file: str = "",
    **options: object,
) -> Node:
    """Return a node of this package; when it ends, everything else ends.

    Args:
        context: The launch under way.
        executable: Name of the executable.
        values: Parameters by name, which come before those of the file.
        file: Argument that holds the path of a parameter file; '' for none.
        options: Further options of the node, such as its namespace.

    Raises:
        FileNotFoundError: There is no such parameter file; ROS would start the node with its defaults.
    """
    path = context.launch_configurations.get(file, "")
    if path and not os.path.isfile(path):
        raise FileNotFoundError(f"got {file}:={path}, expected a parameter file (YAML)")
    return Node(
        package=PACKAGE,
        executable=executable,
        parameters=[*([path] if path else []), dict(values)],
        output="screen",
        on_exit=ending(executable),
        **options,
    )


def process(command: list[SomeSubstitutionsType]) -> ExecuteProcess:
    """Return another command; when it fails, the launch fails with it."""
    return ExecuteProcess(
        cmd=command, output="screen", on_exit=ending(" ".join(map(str, command[:3])), always=False)
    )


def ending(
    name: str, *, always: bool = True
) -> Callable[[ProcessExited, LaunchContext], list[LaunchDescriptionEntity] | None]:
    """Return the handler that ends a launch with a process: with status 0 after a clean end, else with a failure.

    Args:
        name: Name of the process in messages.
        always: End the launch also after a clean end.
    """

    def end(event: ProcessExited, context: LaunchContext) -> list[LaunchDescriptionEntity] | None:
        if event.returncode and not context.is_shutdown:
            # The only way in which a launch file gives `ros2 launch` a status that is not 0.
            raise RuntimeError(f"{name} has ended with status {event.returncode}")
        return [Shutdown(reason=f"{name} has ended")] if always else None

    return end


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)

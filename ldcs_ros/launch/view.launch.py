"""Viewers on a running twin or on a bag: `ros2 launch ldcs_ros view.launch.py foxglove:=true bag:=out/marked`."""

from __future__ import annotations

import tempfile
from pathlib import Path

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from ldcs_ros.ros.common.launching import NAMESPACE, PACKAGE, argument, process


def generate_launch_description() -> LaunchDescription:
    """RViz with our display; foxglove_bridge where it is installed and asked for; a bag played in a loop."""
    display = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "ldcs.rviz"])
    bag = "Bag to play in a loop, one with markers (ldcs view BAG --markers DIR); empty to watch a live twin."
    return LaunchDescription(
        [
            argument("namespace", NAMESPACE, "Namespace of the twin that RViz shows."),
            argument("rviz", "true", "Start RViz (package rviz2)."),
            argument("display", display, "RViz configuration file, written for the namespace /ldcs."),
            argument(
                "foxglove", "false", "Start foxglove_bridge; the layout is config/foxglove_layout.json."
            ),
            argument("port", "8765", "Port that foxglove_bridge listens on."),
            argument("address", "127.0.0.1", "Address that it listens on; 0.0.0.0 opens it to the network."),
            argument("bag", "", bag),
            OpaqueFunction(function=_rviz, condition=IfCondition(LaunchConfiguration("rviz"))),
            Node(
                package="foxglove_bridge",
                executable="foxglove_bridge",
                parameters=[{"port": LaunchConfiguration("port"), "address": LaunchConfiguration("address")}],
                output="screen",
                condition=IfCondition(LaunchConfiguration("foxglove")),
            ),
            OpaqueFunction(function=_player),
        ]
    )


def _rviz(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    display, namespace = (context.launch_configurations[name] for name in ("display", "namespace"))
    if namespace != NAMESPACE:
        # A display names topics in full, so another namespace needs a display of its own.
        text = Path(display).read_text(encoding="utf-8").replace(f"{NAMESPACE}/", f"{namespace.rstrip('/')}/")
        path = Path(tempfile.mkdtemp(prefix="ldcs_view_"), "ldcs.rviz")
        path.write_text(text, encoding="utf-8")
        display = str(path)
    return [
        Node(package="rviz2", executable="rviz2", arguments=["--display-config", display], output="screen")
    ]


def _player(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    bag = context.launch_configurations["bag"]
    return [process(["ros2", "bag", "play", "--loop", bag])] if bag else []

"""Launch the live twin: `ros2 launch ldcs_ros sim.launch.py scene:=rig record:=out/rig namespace:=/left`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "scene": ("paper", str, "shipped scene or path of a scene file"),
    "real_time_factor": ("1.0", float, "simulated seconds a second; -1.0 for as fast as possible"),
    "duration": ("0.0", float, "simulation time at which the node ends [s]; 0.0 for never"),
    "record": ("", str, "folder of a new bag; empty for none"),
    "publish_clock": ("false", bool, "publish simulation time on /clock"),
}


def generate_launch_description() -> LaunchDescription:
    """One node; every argument is a parameter of it, except the namespace."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, _, meaning) in ARGUMENTS.items()
    ]
    declared.append(
        DeclareLaunchArgument("namespace", default_value="/ldcs", description="namespace of the twin")
    )
    values = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (_, kind, _) in ARGUMENTS.items()
    }
    node = Node(
        package="ldcs_ros",
        executable="sim",
        namespace=LaunchConfiguration("namespace"),
        parameters=[values],
        output="screen",
    )
    return LaunchDescription([*declared, node])

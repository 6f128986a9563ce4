"""The content of a bag by its own account: its scene, its topics by name and type, and the mapping they suggest."""

from __future__ import annotations

from ldcs_ros.bags import Recording
from ldcs_ros.scene.load import parse_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.mapping import COMMANDS, CommandSource, Mapping, MeasurementSource

_COMMAND_TYPES = {
    "pressure_command": "std_msgs/msg/Float64MultiArray",
    "torque_command": "sensor_msgs/msg/JointState",
    "external_wrench": "geometry_msgs/msg/WrenchStamped",
}
_POSE = "geometry_msgs/msg/PoseStamped"
_TRANSFORM = "geometry_msgs/msg/TransformStamped"
_PRESSURE = "sensor_msgs/msg/FluidPressure"
# The driver of the tracker names its probes by number; the first one sits on P0, the second one on P1.
_PROBES = {"trakstar0": "P0", "trakstar1": "P1"}


def recorded_scene(recording: Recording) -> Scene | None:
    """Return the scene that a bag carries, of its twin or of the twin beside its rig; None if it carries none.

    Raises:
        SceneError: The scene is invalid in this version.
    """
    # The complete text names every default of its time.
    text = recording.custom_data.get("scene_complete") or recording.custom_data.get("scene")
    if text is None:
        return None
    name = recording.custom_data.get("scene_name", "scene")
    return parse_scene(text, name=name, origin=f"scene of {recording.name}")


def find_topics(recording: Recording, name: str, message_type: str) -> list[str]:
    """Return the topics with messages that end in a name and have a type, the shortest path first.

    A bridge reports its rig under `rig/P0/pose` beside the twin's own `P0/pose`: the shorter path is the twin's.
    """
    found = [
        topic
        for topic, info in recording.topics.items()
        if topic.split("/")[-1] == name and info.type == message_type and recording.counts.get(topic, 0)
    ]
    return sorted(found, key=lambda topic: (topic.count("/"), topic))


def find_topic(recording: Recording, name: str, message_type: str) -> str | None:
    """Return the topic with messages of a name and type that has the shortest path; None if there is none."""
    return next(iter(find_topics(recording, name, message_type)), None)


def guess_mapping(recording: Recording) -> Mapping:
    """Return the mapping that names and types suggest; it may be empty."""
    commands, measurements = [], []
    for topic, info in sorted(recording.topics.items()):
        parts = topic.strip("/").split("/")
        if parts[-1] in COMMANDS and info.type == _COMMAND_TYPES[parts[-1]]:
            commands.append(CommandSource(topic, parts[-1]))
        elif info.type == _POSE and parts[-1] == "pose" and len(parts) > 1 and "truth" not in parts:
            measurements.append(MeasurementSource(topic, parts[-2]))
        elif info.type == _PRESSURE and parts[-1] == "pressure" and len(parts) > 1:
            measurements.append(MeasurementSource(topic, f"{parts[-2]}/pressure"))
    measured = {source.to for source in measurements}
    for topic, info in sorted(recording.topics.items()):
        if info.type == _TRANSFORM and topic.endswith("trakstar_msg"):
            measurements += [
                MeasurementSource(topic, point, child=probe)
                for probe, point in _PROBES.items()
                if point not in measured
            ]
    return Mapping(tuple(commands), tuple(_one_each(measurements)))


def _one_each(measurements: list[MeasurementSource]) -> list[MeasurementSource]:
    # A bridge reports its rig under `rig/P0/pose` beside the twin's own `P0/pose`: the shorter name is its own.
    chosen: dict[str, MeasurementSource] = {}
    for source in sorted(measurements, key=lambda source: -source.topic.count("/")):
        chosen[source.to] = source
    return list(chosen.values())

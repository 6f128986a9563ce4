"""The moments of a bag: at each recorded surface the sheet, its arms and what acts on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.markers import Shown
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.signals.tracks import CLOUD, JOINTS, cloud_positions

WRENCH = "geometry_msgs/msg/WrenchStamped"


@dataclass(frozen=True)
class Moment:
    """One recorded surface and what belongs to it.

    Attributes:
        time: Log time [ns].
        nodes: Nodes along x and y.
        shown: The sheet, the arms and the commanded wrenches.
    """

    time: int
    nodes: tuple[int, int]
    shown: Shown


def scene_of(recording: Any) -> Any | None:
    """Return the scene that a bag carries; None for a bag of another recorder."""
    text = recording.custom_data.get("scene_complete") or recording.custom_data.get("scene")
    if text is None:
        return None
    from ldcs_ros.scene.load import parse_scene

    return parse_scene(text, name=recording.custom_data.get("scene_name", ""), origin=recording.name)


def topic_of(recording: Any, name: str, message_type: str) -> str | None:
    """Return the topic of a name and type, the one with the shortest path; None if there is no message on one."""
    found = [
        topic
        for topic, info in recording.topics.items()
        if topic.strip("/").split("/")[-1] == name
        and info.type == message_type
        and recording.counts.get(topic, 0)
    ]
    return min(found, key=lambda topic: (topic.count("/"), topic), default=None)


def moments(recording: Any, scene: Any | None, *, every: int = 1) -> Iterator[Moment]:
    """Return the moments of a bag in their order.

    Args:
        recording: A Recording.
        scene: Its scene, or None: then there are neither arms nor wrenches.
        every: Take one surface out of so many.

    Raises:
        RecordingError: The bag holds no surface.
    """
    clouds = topic_of(recording, "nodes", CLOUD)
    if clouds is None:
        raise RecordingError(
            f"{recording.name} holds no topic 'nodes' of type {CLOUD}, only {sorted(recording.topics)}; "
            "record the twin's nodes topic to see its surface"
        )
    joints, wrench = (
        topic_of(recording, "joint_states", JOINTS),
        topic_of(recording, "external_wrench", WRENCH),
    )
    state = _State(scene)
    waiting: Moment | None = None
    count = 0
    for message in recording.in_order([topic for topic in (clouds, joints, wrench) if topic is not None]):
        # What belongs to a surface is recorded behind it with the same time.
        if waiting is not None and message.time > waiting.time:
            yield state.complete(waiting)
            waiting = None
        if message.topic == clouds:
            if count % every == 0:
                cloud = recording.decode(message)
                waiting = Moment(
                    message.time, (cloud.height // 2, cloud.width), Shown(cloud_positions(cloud))
                )
            count += 1
        elif message.topic == joints:
            state.joints = np.asarray(recording.decode(message).position, dtype=float)
        else:
            state.take_wrench(message.time, recording.decode(message))
    if waiting is not None:
        yield state.complete(waiting)


class _State:
    """What was last heard of joints and wrenches."""

    def __init__(self, scene: Any | None) -> None:
        self._effects = () if scene is None else tuple(scene.effects)
        self._schedule = () if scene is None else scene.inputs
        self._next = 0
        self._wrenches: dict[str, Wrench] = {}
        self.joints = np.zeros(0)

    def take_wrench(self, time: int, message: Any) -> None:
        self._follow_schedule(time)
        force, torque = message.wrench.force, message.wrench.torque
        # Several twins in one tf tree have a prefix before each frame.
        frame = message.header.frame_id.split("/")[-1]
        self._wrenches[frame] = Wrench((force.x, force.y, force.z), (torque.x, torque.y, torque.z))

    def complete(self, moment: Moment) -> Moment:
        """Return the moment with arms and wrenches, also those that the scene's schedule commands."""
        self._follow_schedule(moment.time)
        named = {effect.name: effect for effect in self._effects}
        angles = np.zeros((0, 0))
        if "arms" in named and self.joints.size == 2 * named["arms"].links:
            angles = np.cumsum(self.joints.reshape(2, -1), axis=1)
        wrenches = dict(self._wrenches) if "wrench" in named else {}
        shown = Shown(moment.shown.position, angles, wrenches)
        return Moment(moment.time, moment.nodes, shown)

    def _follow_schedule(self, time: int) -> None:
        while self._next < len(self._schedule) and 1e9 * self._schedule[self._next].time <= time:
            if (scheduled := self._schedule[self._next].wrench) is not None:
                frame, force, torque = scheduled
                self._wrenches[frame] = Wrench(force, torque)
            self._next += 1

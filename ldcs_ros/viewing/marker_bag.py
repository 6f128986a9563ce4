"""A copy of a bag with the markers of its surfaces, which RViz and Foxglove draw."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from pathlib import Path

from ldcs_ros.bags import BagWriter, Recording, TopicInfo
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.markers import MARKER_TOPICS, Markers
from ldcs_ros.messages.topics import BASE_FRAME, TOPICS
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.topics import find_topic, recorded_scene
from ldcs_ros.signals.tracks import CLOUD, Snapshot, snapshots

_PERIOD = 0.999e9 / 25.0
"""Shortest time between two sets of markers [ns]: at most 25 per second."""


def write_marker_bag(
    recording: Recording, folder: Path, *, progress: Callable[[float], None] | None = None
) -> int:
    """Write a new bag with every message of a bag and, for its surfaces, `surface`, `arms`, `loads`, `traces`.

    Bags are recorded without markers, which would double their size.

    Args:
        recording: A Recording that carries its scene and holds `nodes`.
        folder: New bag folder.
        progress: Called with the finished fraction, 0 ... 1.

    Returns:
        The number of added marker messages.

    Raises:
        RecordingError: The bag has no scene or no surface, has markers already, or the folder cannot be written.
    """
    scene = recorded_scene(recording)
    if scene is None:
        raise RecordingError(f"{recording.name} carries no scene, which arms and loads need")
    clouds = find_topic(recording, "nodes", CLOUD)
    if clouds is None:
        raise RecordingError(f"{recording.name} holds no surface ('nodes'), only {sorted(recording.topics)}")
    namespace = clouds.rpartition("/")[0]
    names = {topic: f"{namespace}/{topic}" for topic in MARKER_TOPICS}
    if taken := sorted(set(names.values()) & set(recording.topics)):
        raise RecordingError(f"{recording.name} holds markers already: {taken}")
    frame = recording.decode(next(iter(recording.in_order([clouds])))).header.frame_id or BASE_FRAME
    topics = {**recording.topics, **{names[topic]: TopicInfo(TOPICS[topic].type) for topic in MARKER_TOPICS}}
    writer = BagWriter(folder, topics=topics, custom_data=dict(recording.custom_data))
    source = _MarkerSource(recording, scene, Markers(scene, frame))
    added = 0
    try:
        for message in itertools.chain(recording.in_order(), [None]):
            for topic, cdr, time in source.before(math.inf if message is None else message.time):
                writer.write(names[topic], TOPICS[topic].type, cdr, time)
                added += 1
            if message is None:
                break
            writer.write(message.topic, message.type, message.cdr, message.time)
            if progress is not None:
                progress((message.time - recording.start) / max(recording.end - recording.start, 1))
    finally:
        writer.close()
    if writer.error is not None:
        raise RecordingError(writer.error)
    return added


class _MarkerSource:
    """The markers of a bag's snapshots, each after the messages of its time."""

    def __init__(self, recording: Recording, scene: Scene, markers: Markers) -> None:
        self._scene = scene
        self._markers = markers
        self._due = -math.inf
        self._snapshots = snapshots(recording, scene)
        self._next: Snapshot | None = next(self._snapshots, None)

    def before(self, time: float) -> Iterator[tuple[str, bytes, int]]:
        """Yield topic, message and time [ns] of the markers before a time [ns]."""
        while (snapshot := self._next) is not None and snapshot.time < time:
            self._next = next(self._snapshots, None)
            position = snapshot.shown.position
            places = {name: point.position(position) for name, point in self._scene.points.items()}
            self._markers.follow(snapshot.time, places)
            if snapshot.time >= self._due:
                self._due = snapshot.time + _PERIOD
                for topic in MARKER_TOPICS:
                    yield topic, self._markers.build(topic, snapshot.time, snapshot.shown), snapshot.time

"""Recorder: the sink that puts a twin's messages into a bag, one bag for each run from the scene's start."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ldcs_ros.bags import BagWriter, Qos, TopicInfo
from ldcs_ros.errors import user_path
from ldcs_ros.messages.topics import Topic
from ldcs_ros.scene.load import complete_text
from ldcs_ros.twin.settings import software_versions
from ldcs_ros.twin.twin import Twin

DEFAULT_NAMESPACE = "/ldcs"


class Recorder:
    """Records a twin; add it to the twin's sinks.

    Trouble with the disk never stops the twin: recording ends, and `error` says why.

    Args:
        folder: Bag folder; one that exists is never overwritten.
        twin: The twin.
        namespace: Namespace put before relative topic names.
        custom_data: Further texts stored with the bag.

    Raises:
        RecordingError: The folder exists or cannot be written.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        twin: Twin,
        *,
        namespace: str = DEFAULT_NAMESPACE,
        custom_data: Mapping[str, str] | None = None,
    ) -> None:
        self._twin = twin
        self._namespace = namespace.rstrip("/")
        self._further = dict(custom_data or {})
        self._first_folder = user_path(folder)
        self._folder_of_scene = self._first_folder
        self._scenes = self._resets = 0
        self._measured_error: float | None = None
        self._writer = self._open(self._first_folder)

    @property
    def folder(self) -> Path:
        """Bag folder of the present run."""
        return self._writer.folder

    @property
    def error(self) -> str | None:
        """Why recording stopped, in one line; None while all is well."""
        return self._writer.error

    @property
    def count(self) -> int:
        """Messages recorded in the present bag."""
        return self._writer.count - self._writer.lost

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        """Record one message, if its topic is one that is recorded."""
        if self._twin.settings.verify:
            self._measured_error = self._twin.simulation.statistics.error_estimate
        name = self._names.get(topic)
        if name is not None:
            self._writer.write(name, message_type, cdr, time_ns)

    def start_next(self) -> None:
        """End the bag and begin the next one, '<folder>_reset1' and so on: time starts again at a reset.

        Raises:
            RecordingError: The next bag cannot be opened; nothing is recorded any more.
        """
        self.close()
        self._resets += 1
        folder = self._folder_of_scene
        self._writer = self._open(folder.with_name(f"{folder.name}_reset{self._resets}"))

    def change_twin(self, twin: Twin) -> None:
        """End the bag and begin one of another twin, '<folder>_scene1' and so on.

        Raises:
            RecordingError: The next bag cannot be opened; nothing is recorded any more.
        """
        self.close()
        self._twin = twin
        self._scenes, self._resets = self._scenes + 1, 0
        first = self._first_folder
        self._folder_of_scene = first.with_name(f"{first.name}_scene{self._scenes}")
        self._writer = self._open(self._folder_of_scene)

    def close(self) -> None:
        """End the bag; the metadata of a verified run name its largest measured error, `measured_error` [m]."""
        if self._measured_error is not None:
            self._writer.add_custom_data({"measured_error": repr(self._measured_error)})
            self._measured_error = None
        self._writer.close()

    def _open(self, folder: Path) -> BagWriter:
        twin = self._twin
        self._names = {name: self._absolute(name) for name, topic in twin.topics.items() if topic.recorded}
        topics = {full: _info(twin.topics[name]) for name, full in self._names.items()}
        said = {**run_metadata(twin), "namespace": self._namespace, **self._further}
        return BagWriter(folder, topics=topics, custom_data=said)

    def _absolute(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._namespace}/{name}"


def run_metadata(twin: Twin) -> dict[str, str]:
    """Return the texts of a bag's metadata from which the same twin can be built again."""
    return {
        "scene": twin.scene.text,
        "scene_complete": complete_text(twin.scene),
        "scene_name": twin.scene.name,
        **replace(twin.settings, tracker_rate=twin.tracker_rate).to_metadata(),
        **software_versions(),
    }


def _info(topic: Topic) -> TopicInfo:
    qos = Qos(
        reliability="reliable" if topic.reliable else "best_effort",
        durability="transient_local" if topic.transient_local else "volatile",
        history="keep_all" if topic.keep_all else "keep_last",
        depth=topic.depth,
    )
    return TopicInfo(topic.type, qos)

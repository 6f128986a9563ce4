"""Recorder: the sink that puts a twin's messages into a bag, one bag for each run from the scene's start."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from ldcs_ros import __version__
from ldcs_ros import bags as recording
from ldcs_ros.messages.topics import Topic
from ldcs_ros.scene.complete import complete_text
from ldcs_ros.twin.twin import Twin

DEFAULT_NAMESPACE = "/ldcs"


class Recorder:
    """Records a twin; add it to the twin's sinks.

    Trouble with the disk never stops the twin: recording ends, and `error` says why.

    Args:
        folder: Bag folder; one that exists is never overwritten.
        twin: What is recorded.
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
        self._first_folder = Path(folder)
        self._folder_of_scene = self._first_folder
        self._scenes = self._resets = 0
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
        return self._writer.count

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        """Record one message, if its topic is one that is recorded."""
        name = self._names.get(topic)
        if name is not None:
            self._writer.write(name, message_type, cdr, time_ns)

    def start_over(self) -> None:
        """End the bag and begin the next one, '<folder>_reset1' and so on: time starts again at a reset.

        Raises:
            RecordingError: The next bag cannot be opened; nothing is recorded any more.
        """
        self._writer.close()
        self._resets += 1
        folder = self._folder_of_scene
        self._writer = self._open(folder.with_name(f"{folder.name}_reset{self._resets}"))

    def change_twin(self, twin: Twin) -> None:
        """End the bag and begin one of another twin, '<folder>_scene1' and so on.

        Raises:
            RecordingError: The next bag cannot be opened; nothing is recorded any more.
        """
        self._writer.close()
        self._twin = twin
        self._scenes, self._resets = self._scenes + 1, 0
        first = self._first_folder
        self._folder_of_scene = first.with_name(f"{first.name}_scene{self._scenes}")
        self._writer = self._open(self._folder_of_scene)

    def close(self) -> None:
        """End the bag."""
        self._writer.close()

    def _open(self, folder: Path) -> recording.BagWriter:
        twin = self._twin
        self._names = {name: self._absolute(name) for name, topic in twin.topics.items() if topic.recorded}
        topics = {full: _info(twin.topics[name]) for name, full in self._names.items()}
        said = {**run_description(twin), "namespace": self._namespace, **self._further}
        return recording.BagWriter(folder, topics=topics, custom_data=said)

    def _absolute(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._namespace}/{name}"


def run_description(twin: Twin) -> dict[str, str]:
    """Return what it takes to run a twin again, as texts."""
    return {
        "scene": twin.scene.text,
        "scene_complete": complete_text(twin.scene),
        "scene_name": str(twin.scene.name),
        "seed": "" if twin.seed is None else str(twin.seed),
        "accuracy": "" if twin.accuracy is None else repr(twin.accuracy),
        "publish_rate": repr(twin.publish_rate),
        "tracker_rate": "" if twin.sensing.tracker is None else repr(twin.sensing.tracker.rate),
        "ambient_pressure": repr(twin.ambient_pressure),
        "publish_clock": str(twin.publish_clock).lower(),
        "publish_tf": str(twin.publish_tf).lower(),
        "frame_prefix": twin.frames.prefix,
        "detail": str(twin.detail).lower(),
        "settled": str(twin.settled).lower(),
        "ldcs_ros": __version__,
        "python": platform.python_version(),
        **{library: metadata.version(library) for library in ("numpy", "scipy", "numba")},
        # What can change a result; the kernel cannot.
        "platform": "-".join([platform.system(), platform.machine(), *platform.libc_ver()]),
    }


def _info(topic: Topic) -> Any:
    qos = recording.Qos(
        reliability="reliable" if topic.reliable else "best_effort",
        durability="transient_local" if topic.transient_local else "volatile",
        history="keep_all" if topic.keep_all else "keep_last",
        depth=topic.depth,
    )
    return recording.TopicInfo(topic.type, qos)

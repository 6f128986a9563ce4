"""What a bag of this project says about its run: enough to build the same twin again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ldcs_ros.errors import RecordingError
from ldcs_ros.scene.load import parse_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.recorder import DEFAULT_NAMESPACE
from ldcs_ros.twin.twin import Sink, Twin

VERSIONS = ("ldcs_ros", "python", "numpy", "scipy", "numba", "platform")
"""Entries of custom_data that must agree for the same bits to be expected."""


@dataclass(frozen=True)
class RunDescription:
    """How a twin was built.

    Attributes:
        scene: Its scene.
        seed: Seed of the sensors' noise, None for the scene's.
        accuracy: Position error asked for [m], None for the scene's.
        publish_rate: Reports a second [Hz].
        tracker_rate: Rate of the tracker [Hz], None for the scene's.
        ambient_pressure: Absolute pressure of the surrounding air [Pa].
        publish_clock: It reported /clock.
        publish_tf: It reported /tf.
        frame_prefix: What stood before the names of its frames.
        detail: It reported lattice_state and solver_status all along.
        settled: It began in the rest state.
        namespace: What stands before its topics in the bag.
        versions: What it ran on, by the names of VERSIONS.
    """

    scene: Scene
    seed: int | None = None
    accuracy: float | None = None
    publish_rate: float = 50.0
    tracker_rate: float | None = None
    ambient_pressure: float = 101325.0
    publish_clock: bool = False
    publish_tf: bool = False
    frame_prefix: str = ""
    detail: bool = False
    settled: bool = False
    namespace: str = DEFAULT_NAMESPACE
    versions: tuple[tuple[str, str], ...] = ()

    def build(self, sinks: Iterable[Sink] = ()) -> Twin:
        """Return a twin at the start of the run; nothing has been emitted."""
        twin = Twin(
            self.scene,
            sinks=sinks,
            seed=self.seed,
            accuracy=self.accuracy,
            publish_rate=self.publish_rate,
            tracker_rate=self.tracker_rate,
            ambient_pressure=self.ambient_pressure,
            publish_clock=self.publish_clock,
            publish_tf=self.publish_tf,
            frame_prefix=self.frame_prefix,
            detail=self.detail,
        )
        if self.settled:
            twin.settle()
        return twin


def describe(recording: Any) -> RunDescription | None:
    """Return how the recorded run was built, None for a bag that is no recording of a twin.

    Raises:
        RecordingError: The bag says it, but not in a way that can be read.
        SceneError: Its scene is not sound for this version.
    """
    said = recording.custom_data
    scene = recorded_scene(recording)
    # The bridge puts its rig's file into the bag of what the rig did.
    if scene is None or "rig" in said:
        return None
    try:
        return RunDescription(
            scene=scene,
            seed=_optional(said, "seed", int),
            accuracy=_optional(said, "accuracy", float),
            publish_rate=float(said.get("publish_rate", 50.0)),
            tracker_rate=_optional(said, "tracker_rate", float),
            ambient_pressure=float(said.get("ambient_pressure", 101325.0)),
            publish_clock=said.get("publish_clock") == "true",
            publish_tf=said.get("publish_tf") == "true",
            frame_prefix=said.get("frame_prefix", ""),
            detail=said.get("detail") == "true",
            settled=said.get("settled") == "true",
            namespace=said.get("namespace", DEFAULT_NAMESPACE),
            versions=tuple((name, said.get(name, "")) for name in VERSIONS),
        )
    except ValueError as error:
        raise RecordingError(f"the custom_data of {recording.name} cannot be read: {error}") from error


def recorded_scene(recording: Any) -> Scene | None:
    """Return the scene that a bag carries, of its twin or of the twin beside its rig; None if it has none.

    Raises:
        SceneError: Its scene is not sound for this version.
    """
    said = recording.custom_data
    # With every default as it was then.
    text = said.get("scene_complete") or said.get("scene")
    if text is None:
        return None
    return parse_scene(text, name=said.get("scene_name", "scene"), origin=f"scene of {recording.name}")


def _optional(said: Any, key: str, convert: Any) -> Any:
    return convert(said[key]) if said.get(key) else None

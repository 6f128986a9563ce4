"""Experiment: the data of a bag for identification - commands with their times, tracker positions, their noise."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import LdcsError, SceneError
from ldcs_ros.identify.starts import Start, start_at
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.replay.external_bag import begun_scene, mapped_commands
from ldcs_ros.replay.own_bag import recorded_run, timeline
from ldcs_ros.replay.span import check_span
from ldcs_ros.scene import Scene
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals import Mapping, guess_mapping
from ldcs_ros.signals.series import Series
from ldcs_ros.signals.signals import read_signals
from ldcs_ros.signals.tables import open_recording
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.commands import Commands, Refusal


class IdentificationError(LdcsError, ValueError):
    """A bag, a parameter or their combination cannot be used for identification."""


# Simulation time [s], relative topic, message.
Command = tuple[float, str, bytes]


@dataclass(frozen=True)
class Experiment:
    """A recorded run, as plain data that worker processes can take.

    Attributes:
        name: Name of the bag.
        commands: (simulation time [s], relative topic, message) of each command, by time.
        settled: It began in the rest state.
        schedule: The recorded scene's own schedule, as in a scene file; empty for a rig's bag.
        points: Names of the tracked points.
        time: Times of the measurements [s], shape (n,), rising.
        position: Measured positions in ldcs_base [m], shape (n, n_points, 3); NaN where a coordinate was not measured.
        noise: Standard deviation of one coordinate [m].
        noise_origin: Source of the noise figure, in words.
        warnings: Irregularities of the bag, in words.
        start: Its unknown start, if it begins in motion.
    """

    name: str
    commands: tuple[Command, ...]
    settled: bool
    schedule: tuple[dict[str, Any], ...]
    points: tuple[str, ...]
    time: np.ndarray
    position: np.ndarray
    noise: float
    noise_origin: str
    warnings: tuple[str, ...] = ()
    start: Start | None = None

    @property
    def count(self) -> int:
        """Measured coordinates."""
        return int(np.isfinite(self.position).sum())


def read_experiment(
    bag: str | os.PathLike[str],
    scene: Scene,
    *,
    mapping: Mapping | None = None,
    noise: float | None = None,
    in_motion: bool = False,
) -> Experiment:
    """Return the experiment of a bag or a table.

    Args:
        bag: A bag of a twin or of a rig, or a table (CSV, Parquet).
        scene: The scene that is to be fitted; its points are compared.
        mapping: Meaning of a rig's topics or a table's columns; None to go by names and types.
        noise: Standard deviation of a measured coordinate [m]; None to take the recorded scene's, or to estimate it.
        in_motion: The bag begins in motion; its start is unknown and is to be fitted, too.

    Raises:
        RecordingError: The bag cannot be read.
        MappingError: The mapping does not fit the bag.
        IdentificationError: No point of the scene was tracked, or a command does not fit the scene.
    """
    recording, mapping = open_recording(bag, mapping)
    check_span(recording)
    name = Path(bag).name
    recorded = recorded_run(recording) if mapping is None else None
    meaning = mapping or guess_mapping(recording)
    warnings: list[str] = list(recording.notes)
    schedule: tuple[dict[str, Any], ...]
    if recorded is not None:
        run = timeline(recording, namespace=recorded.namespace, topics=dict(TOPICS))
        given = [(command.time * 1e-9, command.topic, command.cdr) for command in run.commands]
        commands = _effective(given, scene.without_schedule(), name)
        schedule = tuple(recorded.scene.content.get("inputs", ()))
        settled, shift = recorded.settings.settled, recording.start * 1e-9
    else:
        scene = scene.without_schedule()
        commands, begun, odd = _converted(recording, meaning, scene, name)
        warnings += odd
        schedule = tuple(begun.content.get("inputs", ()))
        settled, shift = meaning.initial != "start", 0.0
    signals = read_signals(recording, name=name, mapping=meaning, measured=True)
    warnings += signals.warnings
    tracks = {
        (point, k): track
        for point in scene.points
        for k, axis in enumerate(AXES)
        if (track := signals.channel(f"{point}.{axis}")) is not None
    }
    points = tuple(dict.fromkeys(point for point, _ in tracks))
    warnings += [
        f"{channel} is of no point of the scene {list(scene.points)}"
        for channel, series in signals.series.items()
        if series.unit == "m" and channel.partition(".")[0] not in scene.points
    ]
    if not points:
        raise IdentificationError(
            f"{name} has no tracker positions of the points {list(scene.points)} of the scene, "
            f"only {list(signals.series)}"
        )
    time = np.unique(np.concatenate([track.time for track in tracks.values()]))
    position = np.full((len(time), len(points), 3), np.nan)
    for (point, k), track in tracks.items():
        position[np.searchsorted(time, track.time), points.index(point), k] = track.value[:, 0]
    sigma, origin = _noise(noise, None if recorded is None else recorded.scene, list(tracks.values()))
    start = _start(scene, schedule, commands, shift) if in_motion else None
    settled = settled or in_motion
    return Experiment(
        name,
        commands,
        settled,
        schedule,
        points,
        time + shift,
        position,
        sigma,
        origin,
        tuple(warnings),
        start,
    )


def _start(
    scene: Scene, schedule: Sequence[dict[str, Any]], commands: Sequence[Command], time: float
) -> Start:
    # Near the rest state under the commands of the first instant.
    simulation = scene.edited(inputs=[entry for entry in schedule if entry["time"] <= time] or None).build()
    receiver = Commands(simulation)
    for due, topic, cdr in commands:
        if due <= max(time, commands[0][0]):
            receiver.receive(topic, cdr)
    simulation.settle()
    return start_at(simulation.operating_point(), time)


def _effective(commands: Sequence[Command], scene: Scene, name: str) -> tuple[Command, ...]:
    # A controller repeats its commands many times per second. Each would restart the steps without an effect.
    simulation = scene.build()
    receiver = Commands(simulation)
    kept: list[Command] = []
    begun: set[str] = set()
    for command in commands:
        before = _commanded(simulation)
        try:
            receiver.receive(command[1], command[2])
        except Refusal as refusal:
            raise IdentificationError(
                f"{name}: the scene refuses the command on {command[1]} at {command[0]:.3f} s: {refusal}"
            ) from refusal
        # The first command of its kind replaces the schedule, also without a change; wrenches do so frame by frame.
        if command[1] not in begun or command[1] == "external_wrench" or _commanded(simulation) != before:
            kept.append(command)
        begun.add(command[1])
    return tuple(kept)


def _commanded(simulation: Simulation) -> list[object]:
    inputs = simulation.inputs
    return [None if value is None else value.tolist() for value in (inputs.pressure, inputs.torque)]


def _converted(
    recording: Recording, mapping: Mapping, scene: Scene, name: str
) -> tuple[tuple[Command, ...], Scene, list[str]]:
    # A rig's messages are converted to the twin's own once, here: the result depends on earlier commands only.
    simulation = scene.build()
    receiver = Commands(simulation)
    mapped, reports, _ = mapped_commands(recording, mapping)
    commands = []
    for timed in mapped:
        command = timed.command(simulation)
        if command is None:
            continue
        try:
            receiver.receive(*command)
        except Refusal as refusal:
            timed.refused(refusal.reason)
            continue
        commands.append((timed.time * 1e-9, *command))
    if not commands:
        raise SceneError(
            f"{name}: no command of the bag fits the scene: {receiver.last_refusal or 'none is mapped'}"
        )
    begun = begun_scene(scene, mapping, mapped)
    return tuple(commands), begun, [f"{i.topic}: {', '.join(i.warnings())}" for i in reports if i.warnings()]


def _noise(given: float | None, scene: Scene | None, tracks: list[Series]) -> tuple[float, str]:
    if given is not None:
        return given, "given"
    tracker = None if scene is None else scene.sensors.get("tracker")
    if tracker is not None and (tracker["noise"] > 0.0 or tracker["quantum"] > 0.0):
        # A quantum q is a uniform error of standard deviation q / sqrt(12).
        return float(
            np.hypot(tracker["noise"], tracker["quantum"] / np.sqrt(12.0))
        ), "the recorded scene's tracker"
    return estimated_noise([track.value for track in tracks]), "estimated from the data's second differences"


def estimated_noise(tracks: list[np.ndarray]) -> float:
    """Return the standard deviation of white noise on smooth tracks [m], each of shape (n, k).

    Second differences of white noise have sqrt(6) times its deviation; their median does not see the few samples in
    which the motion itself is fast.

    Raises:
        IdentificationError: There are too few samples, or none of them differ.
    """
    seconds = [np.abs(np.diff(track, n=2, axis=0)).ravel() for track in tracks if len(track) > 2]
    sigma = 1.4826 * float(np.median(np.concatenate(seconds))) / np.sqrt(6.0) if seconds else 0.0
    if not sigma > 0.0:
        raise IdentificationError(
            "the tracker's noise cannot be estimated from the data; give it with --noise (in m)"
        )
    return sigma

"""The Run of a recording: its signals and commanded pressures at common times, for tables and datasets."""

from __future__ import annotations

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import MappingError
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals import CommandSource, Mapping, fields, guess_mapping
from ldcs_ros.signals.channels import ChannelReport, read_channel
from ldcs_ros.signals.signals import read_signals, surface_values
from ldcs_ros.signals.topics import find_topic, recorded_scene
from ldcs_ros.signals.tracks import Track
from ldcs_ros.tables.run import Run


def run_of(recording: Recording, mapping: Mapping | None, *, measured: bool = False) -> Run:
    """Return what a recording says over time.

    Its times are those of all channels together; a channel without a value at a time is NaN there, and a commanded
    pressure holds until the next one.

    Args:
        recording: A Recording.
        mapping: Meaning of a rig's topics; None to read a twin's bag as such and to guess others.
        measured: Take the points from a twin's tracker, not their true positions.

    Raises:
        RecordingError: There is nothing in it.
        MappingError: The mapping does not fit.
    """
    signals = read_signals(recording, name=recording.name, mapping=mapping, measured=measured)
    commands = commanded_pressures(recording, mapping)
    every = [one.time for one in signals.series.values()] + [one.time for one in commands.values()]
    time = np.unique(np.round(np.concatenate(every), 9)) if every else np.zeros(0)
    channels: dict[str, np.ndarray] = {}
    for name, series in signals.series.items():
        rows, value = np.searchsorted(time, np.round(series.time, 9)), series.value
        point, _, axis = name.rpartition(".")
        if series.axes == AXES:
            channels[name] = np.full((len(time), 3), np.nan)
            channels[name][rows] = value
        elif series.unit == "m":
            channels.setdefault(point, np.full((len(time), 3), np.nan))[rows, AXES.index(axis)] = value[:, 0]
        else:
            channels[name] = np.full(len(time), np.nan)
            channels[name][rows] = value[:, 0]
    for arm, track in commands.items():
        index = np.searchsorted(track.time, time + 1e-9, side="right") - 1
        channels[f"pressure_command.{arm}"] = np.where(index < 0, 0.0, track.value[np.maximum(index, 0)])
    surface = Track(np.zeros(0), np.zeros((0, 2, 0, 0, 3)))
    if signals.surface is not None:
        surface = surface_values(signals.surface)
    return Run(time, channels, surface.time, surface.value, signals.title)


def commanded_pressures(recording: Recording, mapping: Mapping | None) -> dict[str, Track]:
    """Return the commanded gauge pressures [Pa], shape (n,), by arm; each holds until the next one.

    Those of a recorded scene's own schedule hold until the first message. Without a scene the arms are those that the
    mapping names, or `0`, `1` by their places.

    Raises:
        MappingError: The mapping does not fit.
    """
    scene = recorded_scene(recording)
    sources: tuple[CommandSource, ...] = (mapping or guess_mapping(recording)).commands
    own = find_topic(recording, "pressure_command", TOPICS["pressure_command"].type)
    if mapping is None and own is not None:
        sources = (CommandSource(own, "pressure_command"),)
    ambient = mapping.ambient_pressure if mapping is not None else 0.0
    simulation = None if scene is None else scene.build()
    arms = () if simulation is None else simulation.arm_names
    found: list[tuple[float, tuple[str, ...], np.ndarray]] = []
    for source in sources:
        if source.to == "pressure_command":
            found += _messages(recording, source, mapping, arms, ambient)
    found.sort(key=lambda one: one[0])
    if scene is not None and mapping is None:
        first = found[0][0] if found else np.inf
        scheduled = [
            (entry.time, arms, np.atleast_1d(np.asarray(entry.pressure, dtype=float)))
            for entry in scene.inputs
            if entry.pressure is not None and entry.time < first
        ]
        found = scheduled + found
    held: dict[str, tuple[list[float], list[float]]] = {}
    for time, names, values in found:
        for name, value in zip(names, np.broadcast_to(values, len(names)).tolist(), strict=True):
            times, pressures = held.setdefault(name, ([], []))
            times.append(time)
            pressures.append(value)
    return {arm: Track(np.array(times), np.array(pressures)) for arm, (times, pressures) in held.items()}


def _messages(
    recording: Recording,
    source: CommandSource,
    mapping: Mapping | None,
    arms: tuple[str, ...],
    ambient: float,
) -> list[tuple[float, tuple[str, ...], np.ndarray]]:
    kind = recording.topics[source.topic].type if source.topic in recording.topics else ""
    by, late = ("log", 0.1) if mapping is None else (mapping.time or "log", mapping.late)
    decoded = read_channel(recording, source.topic, ChannelReport(source.topic), by=by, late=late, gap=None)
    offset = fields.default_offset(kind, ambient) if source.offset is None else source.offset
    # A twin's bag counts from its simulation's zero, a rig's from its first message.
    origin = 0 if mapping is None and "scene" in recording.custom_data else recording.start
    found = []
    for one in decoded:
        values = source.scale * fields.numbers(one.message, source.field, kind) - offset
        names = source.arms or arms or tuple(str(k) for k in range(values.size))
        if values.size not in (1, len(names)):
            raise MappingError(f"got {values.size} pressures on {source.topic}, expected 1 or {len(names)}")
        found.append(((one.time - origin) * 1e-9, names, values))
    return found

"""Signals: the points, pressures, joints and surface of a recording over time, in SI units and ldcs_base."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals import Mapping, MappingError, MeasurementSource, fields, guess_mapping
from ldcs_ros.signals.channels import ChannelReport, DecodedMessage, read_channel
from ldcs_ros.signals.series import Series, clean
from ldcs_ros.signals.topics import find_topic, recorded_scene
from ldcs_ros.signals.tracks import (
    CLOUD,
    JOINTS,
    POSE,
    PRESSURE,
    WALL_CLOCK,
    SurfaceTrack,
    Track,
    check_one_clock,
    joint_tracks,
    point_tracks,
    pressure_tracks,
    surface_track,
)

_READ = (CLOUD, JOINTS, POSE, PRESSURE)


@dataclass(frozen=True)
class Signals:
    """The quantities of one recording over time.

    Attributes:
        name: Name in reports.
        series: Channels by name: points (`P1`), `left/pressure` (gauge), `joint/left_joint_1`.
        surface: All nodes over time, None if they are not recorded.
        in_simulation_time: Its times are a simulation's, which begins at zero.
        side_length: Length of the sheet [m], None if the recording does not say.
        title: Title of its scene, '' without one.
        warnings: Its irregularities, in words.
    """

    name: str
    series: dict[str, Series]
    surface: SurfaceTrack | None
    in_simulation_time: bool
    side_length: float | None = None
    title: str = ""
    warnings: list[str] = field(default_factory=list)

    def channel(self, name: str) -> Series | None:
        """Return a channel, or the coordinate `P1.z` of a point; None without one."""
        found = self.series.get(name)
        point, _, axis = name.rpartition(".")
        whole = self.series.get(point)
        if found is not None or whole is None or axis not in whole.axes:
            return found
        value = whole.value[:, whole.axes.index(axis)]
        return replace(whole, value=value[:, None], axes=("",))


def read_signals(recording: Recording, *, name: str, mapping: Mapping | None, measured: bool) -> Signals:
    """Return the signals of a recording.

    Args:
        recording: A Recording.
        name: Name in reports.
        mapping: Meaning of a rig's topics; None to read a twin's bag as such and to guess others.
        measured: Take the points from a twin's tracker, not their true positions.

    Raises:
        RecordingError: Nothing in it can be compared, or its recorder's clock was set.
        MappingError: The mapping does not fit.
    """
    check_one_clock(recording)
    if mapping is None and ("scene" in recording.custom_data or _has_truth(recording)):
        signals = _twin_signals(recording, name, measured)
    else:
        signals = _rig_signals(recording, name, mapping or guess_mapping(recording))
    if not signals.series and signals.surface is None:
        found = f" ({'; '.join(signals.warnings)[:300]})" if signals.warnings else ""
        raise RecordingError(
            f"{recording.name} holds no points, pressures, joints or nodes{found}; "
            f"name its topics in a mapping file, it has {sorted(recording.topics)}"
        )
    return signals


def _twin_signals(recording: Recording, name: str, measured: bool) -> Signals:
    recording.load([topic for topic, info in recording.topics.items() if info.type in _READ])
    warnings: list[str] = []
    series: dict[str, Series] = {}
    truth, reported = point_tracks(recording, truth=True), point_tracks(recording, truth=False)
    points = {**truth, **reported} if measured else {**reported, **truth}
    for point, track in points.items():
        smooth = point in truth and not (measured and point in reported)
        _add(series, point, track.time, track.value, AXES, "m", smooth, warnings)
    for arm, track in pressure_tracks(recording).items():
        _add(
            series,
            f"{arm}/pressure",
            track.time,
            track.value[:, None],
            ("",),
            "Pa",
            False,
            warnings,
        )
    joints = joint_tracks(recording)
    if joints is not None:
        names, angle, _ = joints
        for k, joint in enumerate(names):
            _add(
                series, f"joint/{joint}", angle.time, angle.value[:, k : k + 1], ("",), "rad", True, warnings
            )
    surface = _surface(recording, warnings)
    scene = recorded_scene(recording)
    length, title = (None, "") if scene is None else (scene.lattice.size[0], scene.title)
    simulated = recording.start < WALL_CLOCK
    return Signals(name, series, surface, simulated, length, title, warnings)


def _rig_signals(recording: Recording, name: str, mapping: Mapping) -> Signals:
    warnings: list[str] = []
    series: dict[str, Series] = {}
    for source in mapping.measurements:
        report = ChannelReport(source.topic)
        decoded = read_channel(
            recording,
            source.topic,
            report,
            by=mapping.time or "stamp",
            late=mapping.late,
            gap=mapping.gap,
            child=source.child,
        )
        kind = recording.topics[source.topic].type
        time, value = _measured(decoded, source, kind, report, mapping.ambient_pressure)
        found = report.warnings()
        warning = f"{source.topic}: {', '.join(found)}"
        if found and warning not in warnings:
            warnings.append(warning)
        if not len(time):
            warnings.append(f"{source.topic}: no message for {source.to}")
            continue
        axes = AXES if source.to.isidentifier() else ("",)
        unit = "Pa" if source.to.endswith("/pressure") else "rad" if source.to.startswith("joint/") else "m"
        _add(series, source.to, (time - recording.start) * 1e-9, value, axes, unit, False, warnings)
    return Signals(name, series, _surface(recording, warnings), False, warnings=warnings)


def _surface(recording: Recording, warnings: list[str]) -> SurfaceTrack | None:
    """Return the surface; None without one, with a warning if its clouds are no sheet."""
    if find_topic(recording, "nodes", CLOUD) is None:
        return None
    try:
        return surface_track(recording)
    except RecordingError as error:
        warnings.append(f"surface left out: {error}")
        return None


def _measured(
    decoded: list[DecodedMessage], source: MeasurementSource, kind: str, report: ChannelReport, ambient: float
) -> tuple[np.ndarray, np.ndarray]:
    times, values = [], []
    for one in decoded:
        try:
            value = _value(one.message, source, kind, ambient)
        except MappingError as error:
            report.malformed += 1
            report.problem = report.problem or str(error)
            continue
        times.append(one.time)
        values.append(value)
    return np.array(times, dtype=np.int64), np.array(values)


def _value(message: object, source: MeasurementSource, kind: str, ambient: float) -> np.ndarray:
    if source.to.endswith("/pressure"):
        offset = fields.default_offset(kind, ambient) if source.offset is None else source.offset
        return np.array([source.scale * _number(message, source, kind, source.field) - offset])
    if source.to.startswith("joint/"):
        path = source.field or ("position" if kind == "sensor_msgs/msg/JointState" else "")
        return np.array([source.scale * _number(message, source, kind, path)])
    if source.axis is None:
        place = fields.position(message, source.field, kind)
    else:
        place = _number(message, source, kind, source.field) * np.eye(3)[source.axis]
    found = source.in_base(source.scale * place)
    return found if source.axis is None else found[[source.axis]]


def _number(message: object, source: MeasurementSource, kind: str, path: str) -> float:
    values = fields.numbers(message, path, kind)
    joint = source.to.removeprefix("joint/")
    index = source.index
    names = list(getattr(message, "name", ()))
    if index is None and joint != source.to and joint in names:
        index = names.index(joint)
    if index is None and values.size != 1:
        raise MappingError(
            f"{source.topic} has {values.size} values; name with 'index:' the one of {source.to}"
        )
    if index is not None and index >= values.size:
        raise MappingError(f"{source.topic} has {values.size} values, there is no index {index}")
    return float(values[index or 0])


def _add(
    series: dict[str, Series],
    name: str,
    time: np.ndarray,
    value: np.ndarray,
    axes: tuple[str, ...],
    unit: str,
    smooth: bool,
    warnings: list[str],
) -> None:
    time, value, dropped = clean(np.asarray(time, dtype=float), np.asarray(value, dtype=float))
    if dropped:
        warnings.append(f"{name}: {dropped} values dropped that were not finite or had the time of another")
    if len(time):
        series[name] = Series(time, value, axes, unit, smooth)


def _has_truth(recording: Recording) -> bool:
    return any("/truth/" in topic for topic in recording.topics)


def surface_values(surface: SurfaceTrack) -> Track:
    """Return all node positions over time [m], shape (n, 2, nx, ny, 3), each time once."""
    first = np.append(True, np.diff(surface.time) > 0.0)
    places = np.stack([surface.position(int(k)) for k in np.flatnonzero(first)])
    return Track(surface.time[first], places)

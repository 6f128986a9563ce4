"""A bag written as a rerun recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError, ViewingError
from ldcs_ros.messages.display.markers import Markers
from ldcs_ros.scene.scene import Scene
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.signals.topics import find_topic, recorded_scene
from ldcs_ros.signals.tracks import (
    CLOUD,
    Snapshot,
    Track,
    joint_tracks,
    point_tracks,
    pressure_tracks,
    seconds,
    snapshots,
)
from ldcs_ros.viewing.blueprint import blueprint
from ldcs_ros.viewing.rerun_package import new_stream
from ldcs_ros.viewing.rerun_scene import ARMS, LOADS, RerunScene

MOST_SURFACES = 3000
"""Largest number of surfaces of a long bag, evenly spread: a browser keeps them in memory."""

MM, KPA = 1e3, 1e-3
_AXES = "xyz"


@dataclass(frozen=True)
class Written:
    """The content of a written view.

    Attributes:
        start: First time that is shown [s].
        end: Last time that is shown [s].
        surfaces: Surfaces that are shown.
        every: Interval of the shown surfaces among the recorded ones.
        points: Named points.
        plots: Titles of the plots.
    """

    start: float
    end: float
    surfaces: int
    every: int
    points: tuple[str, ...]
    plots: tuple[str, ...]


def write_bag(
    recording: Recording,
    path: Path,
    *,
    until: float = math.inf,
    play: str = "playing",
    frame: bool = True,
    most_surfaces: int = MOST_SURFACES,
    progress: Callable[[float], None] | None = None,
) -> Written:
    """Write a bag into a .rrd file: surface, arms, loads, points, traces, plots, and the layout.

    Args:
        recording: A Recording.
        path: File to write.
        until: Last time that is shown [s].
        play: State of the viewer: 'playing', 'paused' at the start, or 'following' at the end.
        frame: Show the viewer's own menu bar.
        most_surfaces: Largest number of surfaces.
        progress: Called with the finished fraction, 0 ... 1.

    Raises:
        RecordingError: The bag holds neither surface nor points until then.
        ViewingError: The viewer's library is missing, or the file cannot be written.
    """
    scene = recorded_scene(recording)
    clouds = find_topic(recording, "nodes", CLOUD)
    truth, measured = (_cut(point_tracks(recording, truth=kind), until) for kind in (True, False))
    if clouds is None and not truth and not measured:
        raise RecordingError(
            f"{recording.name} holds neither a surface ('nodes') nor poses of points up to {until:g} s, only "
            f"{sorted(recording.topics)}; there is nothing to show"
        )
    stream = new_stream(Path(recording.name).name)
    try:
        stream.save(path)
    except Exception as error:  # the library raises what its own layers raise
        raise ViewingError(f"{path} cannot be written: {error}") from error
    rerun_scene = RerunScene(stream, length=None if scene is None else float(scene.lattice.size[0]))
    for name, track in (truth or measured).items():
        thin = slice(None, None, max(1, math.ceil(len(track.time) / (4 * most_surfaces))))
        rerun_scene.points(track.time[thin], {name: track.value[thin]})
    _write_curves(rerun_scene, recording, scene, truth, measured, until)
    # The layout comes first: it holds whether the viewer plays or waits.
    size = None if scene is None else np.asarray(scene.lattice.size)
    layout = blueprint(rerun_scene.point_names, rerun_scene.plots, size=size, play=play, frame=frame)
    stream.send_blueprint(layout)
    stream.flush()
    every = 1 if clouds is None else max(1, math.ceil(recording.counts[clouds] / most_surfaces))
    times: list[float] = []
    if clouds is not None:
        markers = None if scene is None else Markers(scene)
        for snapshot in snapshots(recording, scene, every=every):
            time = float(seconds(np.array([snapshot.time]), recording.start)[0])
            if time > until + TIME_TOLERANCE:
                break
            times.append(time)
            _show(rerun_scene, markers, time, snapshot)
            if progress is not None:
                progress((snapshot.time - recording.start) / max(recording.end - recording.start, 1))
    stream.disconnect()
    present = np.concatenate([np.asarray(times), *(track.time for track in (truth or measured).values())])
    if not present.size:
        raise RecordingError(f"{recording.name} holds nothing up to {until:g} s; choose a later time")
    shown = (len(times), every, tuple(rerun_scene.point_names), tuple(rerun_scene.plots))
    return Written(round(float(present.min()), 9), round(float(present.max()), 9), *shown)


def _show(rerun_scene: RerunScene, markers: Markers | None, time: float, snapshot: Snapshot) -> None:
    rerun_scene.sheet(time, snapshot.nodes, snapshot.shown.position)
    if markers is not None:
        rerun_scene.specs(ARMS, time, markers.specs("arms", snapshot.shown))
        rerun_scene.specs(LOADS, time, markers.specs("loads", snapshot.shown))


def _write_curves(
    rerun_scene: RerunScene,
    recording: Recording,
    scene: Scene | None,
    truth: dict[str, Track],
    measured: dict[str, Track],
    until: float,
) -> None:
    """Write the curves of points and drives."""
    for name in sorted({*truth, *measured}):
        origin = (truth if name in truth else measured)[name].first
        if scene is not None and name in scene.points:
            origin = scene.points[name].position(scene.lattice.reference_position)
        for tracks, plot, dots in ((truth, f"{name} state", False), (measured, f"{name} tracker", True)):
            if name in tracks:
                moved = MM * (tracks[name].value - origin)
                rerun_scene.curves(f"{plot}: displacement [mm]", _AXES, tracks[name].time, moved, dots=dots)
    for arm, track in _cut(pressure_tracks(recording), until).items():
        rerun_scene.curves("gauge pressure [kPa]", [arm], track.time, KPA * track.value[:, None])
    joints = joint_tracks(recording)
    if joints is not None:
        names, angle, torque = joints
        drives = {"drive torque [N m]": torque, "joint angle [deg]": angle}
        for plot, track in _cut(drives, until).items():
            if track.value.size:
                factor = np.rad2deg(1.0) if "deg" in plot else 1.0
                rerun_scene.curves(plot, names, track.time, factor * track.value)


def _cut(tracks: Mapping[str, Track], until: float) -> dict[str, Track]:
    """Return tracks up to a time [s], without tracks that start later."""
    kept = {name: track.time <= until + TIME_TOLERANCE for name, track in tracks.items()}
    return {
        name: Track(track.time[kept[name]], track.value[kept[name]])
        for name, track in tracks.items()
        if kept[name].any()
    }

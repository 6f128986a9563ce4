"""All pictures of a recording at once: which there are, at which times, under which names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.plotting.annotations import annotations_of
from ldcs_ros.plotting.drives import drives_figure
from ldcs_ros.plotting.motion import check_kind, save_motion
from ldcs_ros.plotting.points import points_figure
from ldcs_ros.plotting.style import SCREEN, FigureStyle, save_figure
from ldcs_ros.plotting.surface import surface_figure
from ldcs_ros.signals.commanded import commanded_pressures
from ldcs_ros.signals.topics import recorded_scene
from ldcs_ros.signals.tracks import (
    SurfaceTrack,
    joint_tracks,
    point_tracks,
    pressure_tracks,
    surface_track,
)

_SAMPLES = 60  # clouds looked at to find where the motion is
_PARTS = (1.0 / 3.0, 2.0 / 3.0)  # of the motion, at which a cloud is drawn between the first and the last


def draw(
    recording: Recording,
    folder: Path,
    *,
    times: Sequence[float] | None = None,
    animate: str | None = None,
    kind: str = "png",
    style: FigureStyle = SCREEN,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write the pictures of a recording into a folder and return their paths.

    surface.png (the sheet at chosen times), points.png (displacement against time), drives.png (pressures,
    torques, joint angles) if the arms are recorded, motion.gif or motion.mp4 if asked for.

    Args:
        recording: A Recording.
        folder: Where to; made if needed.
        times: Times of the surfaces [s]; None picks times that tell the motion.
        animate: 'gif', 'mp4' or None.
        kind: Format of the others: 'png', 'pdf', 'svg'.
        style: Their sizes, for a screen or for print.
        progress: Called with (pictures drawn, pictures in all) of the moving picture.

    Raises:
        RecordingError: The recording holds no surface, or a time is outside of it; nothing is written.
        MovieError: MP4 was asked for and there is no ffmpeg; nothing is written.
    """
    if animate is not None:
        check_kind(animate)
    track = surface_track(recording)
    indices = _asked(track, times) if times else informative_indices(track)
    annotations = annotations_of(recording, track)
    folder.mkdir(parents=True, exist_ok=True)
    positions = [track.position(index) for index in indices]
    stamps = [float(track.time[index]) for index in indices]

    def save(figure: Figure, name: str) -> Path:
        return save_figure(figure, folder / f"{name}.{kind}", style)

    written = [save(surface_figure(positions, stamps, annotations, style), "surface")]
    truth, measured = point_tracks(recording, truth=True), point_tracks(recording, truth=False)
    if truth or measured:
        figure = points_figure(truth, measured, annotations.point_rest, title=annotations.title, style=style)
        written.append(save(figure, "points"))
    commanded = commanded_pressures(recording, recorded_scene(recording), float(track.time[-1]))
    drives = drives_figure(
        pressure_tracks(recording),
        joint_tracks(recording),
        commanded=commanded,
        title=annotations.title,
        style=style,
    )
    if drives is not None:
        written.append(save(drives, "drives"))
    if animate is not None:
        written.append(save_motion(track, annotations, folder / f"motion.{animate}", progress=progress))
    return written


def informative_indices(track: SurfaceTrack) -> list[int]:
    """Return the first and the last cloud, and those at which the motion has gone a third and two thirds of its way."""
    samples = np.unique(np.linspace(0, len(track) - 1, min(len(track), _SAMPLES)).astype(int))
    start = track.position(0)
    apart = [np.linalg.norm(track.position(index) - start, axis=-1) for index in samples]
    moved = np.array([np.max(one, initial=0.0, where=np.isfinite(one)) for one in apart])
    if moved.max() < 1e-6:
        return [len(track) - 1]
    between = [int(samples[np.argmax(moved >= part * moved.max())]) for part in _PARTS]
    return sorted({0, *between, len(track) - 1})


def _asked(track: SurfaceTrack, times: Sequence[float]) -> list[int]:
    start, end = float(track.time[0]), float(track.time[-1])
    slack = 0.5 * (end - start) / max(len(track) - 1, 1) + 1e-9
    for time in times:
        if not start - slack <= time <= end + slack:
            raise RecordingError(
                f"time {time:g} s is outside of the recorded surface, {start:g} ... {end:g} s; choose others"
            )
    return [track.index(time) for time in times]

"""The motion of the sheet as a small GIF, or as an MP4 where ffmpeg is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image

from ldcs_ros.errors import LdcsError
from ldcs_ros.plotting.annotations import Annotations
from ldcs_ros.plotting.axes3d import new_axes_3d
from ldcs_ros.plotting.style import INK, LABEL_SIZE, LOAD_COLOUR, SURFACE_MAP, add_title, new_figure
from ldcs_ros.plotting.surface import add_displacement_key, common_frame, draw_surface
from ldcs_ros.signals.tracks import SurfaceTrack

WIDTH, HEIGHT, DPI = 5.2, 3.8, 100
FRAME_RATE = 20.0
MOST_FRAMES = 160
_END_PAUSE = 1.2  # s of the last picture of a GIF


class MovieError(LdcsError, OSError):
    """A moving picture cannot be written."""


def frame_times(track: SurfaceTrack) -> np.ndarray:
    """Return the times of the pictures [s], shape (n,): FRAME_RATE per second, fewer when the recording is long."""
    start, end = float(track.time[0]), float(track.time[-1])
    count = min(round((end - start) * FRAME_RATE) + 1, MOST_FRAMES)
    return np.linspace(start, end, max(count, 2))


def check_kind(kind: str) -> None:
    """Raise MovieError if a moving picture of a kind, 'gif' or 'mp4', cannot be made here."""
    if kind == "mp4" and shutil.which("ffmpeg") is None:
        raise MovieError("no ffmpeg here to write MP4: install ffmpeg, or ask for a GIF with --animate gif")


def save_motion(
    track: SurfaceTrack,
    annotations: Annotations,
    path: Path,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Draw the recorded motion into `path`, a .gif or an .mp4; the file appears whole or not at all.

    Args:
        track: The recorded surface.
        annotations: Rest shape, arms and loads of the scene.
        path: File to write; its ending is the kind.
        progress: Called with (pictures drawn, pictures in all).

    Raises:
        MovieError: MP4 was asked for and there is no ffmpeg, or ffmpeg failed.
    """
    check_kind(path.suffix[1:])
    times = frame_times(track)
    period = float(times[-1] - times[0]) / (len(times) - 1)
    partial = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        pictures = _pictures(track, annotations, times, progress)
        if path.suffix == ".mp4":
            _write_mp4(partial, pictures, rate=1.0 / max(period, 1e-3))
        else:
            _write_gif(partial, pictures, period=period)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def _pictures(
    track: SurfaceTrack,
    annotations: Annotations,
    times: np.ndarray,
    progress: Callable[[int, int], None] | None,
) -> list[Image.Image]:
    figure = new_figure(WIDTH, HEIGHT, dpi=DPI)
    indices = [track.index(time) for time in times]
    frame = common_frame([track.position(index) for index in indices], annotations.rest)
    add_title(figure, annotations.title)
    stamp = figure.text(0.15 / WIDTH, 1.0 - 0.36 / HEIGHT, "", fontsize=LABEL_SIZE, color=INK, va="top")
    add_displacement_key(figure, figure.add_axes((0.845, 0.22, 0.022, 0.5)), frame)
    axes = new_axes_3d(figure, (0.0, 0.02, 0.84, 0.94))
    pictures = []
    for number, index in enumerate(indices):
        axes.clear()
        draw_surface(axes, track.position(index), annotations, frame, large=False)
        stamp.set_text(f"t = {track.time[index]:.2f} s")
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
        pictures.append(Image.fromarray(pixels[..., :3].copy()))
        if progress is not None:
            progress(number + 1, len(indices))
    return pictures


def _write_gif(path: Path, pictures: list[Image.Image], *, period: float) -> None:
    # One palette for all pictures: no flicker, a small file.
    palette = _swatches(pictures[-1]).quantize(colors=256, dither=Image.Dither.NONE)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    # GIF counts in hundredths of a second, and viewers slow down frames shorter than two of them.
    shown = max(round(100.0 * period), 2) * 10
    durations = [shown] * (len(frames) - 1) + [int(1000 * _END_PAUSE)]
    frames[0].save(
        path, format="GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=True
    )


def _swatches(picture: Image.Image) -> Image.Image:
    """Return the picture beside patches of every colour of the scale, so that a palette keeps rare ones."""
    scale = SURFACE_MAP(np.linspace(0.0, 1.0, 48))[:, :3]
    colours = np.concatenate([scale, 0.8 * scale, 0.6 * scale, [to_rgb(LOAD_COLOUR)] * 4])
    rows = np.linspace(0, len(colours), picture.height, endpoint=False).astype(int)
    patches = np.repeat(np.uint8(255 * colours[rows])[:, None, :], picture.width // 3, axis=1)
    return Image.fromarray(np.concatenate([np.asarray(picture), patches], axis=1))


def _write_mp4(path: Path, pictures: list[Image.Image], *, rate: float) -> None:
    width, height = pictures[0].size
    source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {rate:.4f} -i -"
    target = "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2 -pix_fmt yuv420p"
    command = ["ffmpeg", "-y", "-loglevel", "error", *source.split(), *target.split(), str(path)]
    pixels = b"".join(picture.tobytes() for picture in pictures)
    done = subprocess.run(command, input=pixels, capture_output=True, check=False)
    if done.returncode != 0:
        reason = done.stderr.decode(errors="replace").strip().splitlines()
        raise MovieError(
            f"ffmpeg could not write {path.name}: {reason[-1] if reason else 'it gave no reason'}"
        )

"""Pictures are written whole, are not blank, and show what they are asked for."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.errors import RecordingError
from ldcs_ros.plotting import motion
from ldcs_ros.plotting.annotations import annotations_of
from ldcs_ros.plotting.drives import drives_figure
from ldcs_ros.plotting.pictures import draw, informative_indices
from ldcs_ros.plotting.points import points_figure
from ldcs_ros.plotting.style import STYLES
from ldcs_ros.plotting.surface import surface_figure
from ldcs_ros.signals.tracks import Track, joint_tracks, point_tracks, pressure_tracks, surface_track


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"))


def inked(path):
    """Return the share of pixels that are not white."""
    return float((pixels(path) < 245).any(axis=-1).mean())


def test_every_picture_has_content(recording, tmp_path):
    written = draw(recording, tmp_path / "new" / "folder")
    assert [path.name for path in written] == ["surface.png", "points.png", "drives.png"]
    for path in written:
        height, width, _ = pixels(path).shape
        assert width > 900 and height > 400
        assert inked(path) > 0.02
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == sorted(
        path.name for path in written
    )


def test_arms_are_black_and_loads_are_red(recording, tmp_path):
    (surface, *_) = draw(recording, tmp_path, times=[0.4])
    image = pixels(surface).astype(int)
    black = (image.max(axis=-1) < 12).mean()
    red = ((image[..., 0] > 150) & (image[..., 1] < 60) & (image[..., 2] < 80)).mean()
    assert black > 2e-3 and red > 2e-4


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("mould", "perforated", "single_spring") else pytest.mark.slow)
        for name in shipped_scenes()
    ],
)
def test_every_shipped_scene_can_be_drawn(name, record, tmp_path):
    written = draw(record(load_scene(name), until=0.06), tmp_path, times=[0.0, 0.06])
    assert all(inked(path) > 0.01 for path in written)


def test_a_foreign_bag_without_a_scene_can_be_drawn(recording, tmp_path):
    foreign = replace(recording, custom_data={})
    assert inked(draw(foreign, tmp_path, times=[0.4])[0]) > 0.02


def test_more_times_make_more_panels(recording):
    track = surface_track(recording)
    annotations = annotations_of(recording, track)
    widths = []
    for count in (2, 4, 6):
        figure = surface_figure([track.position(k) for k in range(count)], track.time[:count], annotations)
        panels = [axes for axes in figure.axes if axes.name == "3d"]
        assert len(panels) == count
        widths.append(figure.get_figwidth())
    # Six are laid out in two rows of three.
    assert widths[2] < widths[1]


def test_axes_are_scaled_equally(recording):
    track = surface_track(recording)
    figure = surface_figure([track.position(-1)], [0.4], annotations_of(recording, track))
    axes = figure.axes[0]
    spans = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    shown = axes._box_aspect
    assert np.allclose(spans / shown, spans[0] / shown[0])


def test_the_default_times_follow_the_motion(recording):
    track = surface_track(recording)
    indices = informative_indices(track)
    assert indices[0] == 0 and indices[-1] == len(track) - 1 and 2 < len(indices) <= 4
    moved = [np.abs(track.position(k) - track.position(0)).max() for k in indices]
    assert moved[1] < 0.8 * max(moved)


def test_a_time_outside_of_the_recording_is_refused_before_anything_is_written(recording, tmp_path):
    with pytest.raises(RecordingError, match=r"outside of the recorded surface, 0 ... 0.4 s"):
        draw(recording, tmp_path / "pictures", times=[0.1, 9.0])
    assert not (tmp_path / "pictures").exists()


def test_a_single_moment_can_be_drawn(still, tmp_path, recwarn):
    written = draw(still, tmp_path)
    assert len(written) == 3 and all(inked(path) > 0.01 for path in written)
    assert not [str(warning.message) for warning in recwarn]


def test_equal_lines_are_drawn_once_and_different_arms_apart(recording):
    figure = drives_figure(pressure_tracks(recording), joint_tracks(recording), title="")
    labels = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in figure.axes]
    assert labels[0] == ["left", "right"]
    assert labels[1] == ["left joints 1-4", "right joints 1-4"]


def test_sixteen_arms_have_a_key_of_arms_in_their_order_and_one_look_in_all_panels():
    time, arms = np.linspace(0.0, 1.0, 5), [f"arm_with_a_long_name_{k}" for k in range(16)]
    pressures = {arm: Track(time, 1e3 * time * (k + 1)) for k, arm in sorted(enumerate(arms), key=str)}
    names = tuple(f"{arm}_joint_{joint}" for arm in arms for joint in range(1, 5))
    angles = Track(time, np.outer(time, np.arange(64)))
    torques = Track(time, np.outer(time, np.repeat(np.arange(1, 17), 4)))
    figure = drives_figure(pressures, (names, angles, torques), commanded=pressures, title="Sixteen")
    assert [len(axes.lines) - 1 for axes in figure.axes] == [32, 16, 64]
    looks = []
    for axes in figure.axes:
        assert axes.get_position().width > 0.3
        key = axes.get_legend()
        assert len(key.get_texts()) in (16, 17) and all(len(text.get_text()) < 20 for text in key.get_texts())
        assert len({text.get_text() for text in key.get_texts()}) == len(key.get_texts())
        looks.append([(line.get_color(), line.get_linestyle()) for line in key.get_lines()[:16]])
    assert looks[0] == looks[1] == looks[2] and len(set(looks[0])) == 16


def test_the_motion_is_a_moving_gif(recording, tmp_path):
    told = []
    written = draw(
        recording, tmp_path, animate="gif", progress=lambda done, total: told.append((done, total))
    )
    assert written[-1].name == "motion.gif"
    with Image.open(written[-1]) as image:
        assert image.n_frames == 9 == told[-1][0] == told[-1][1]
        first = np.asarray(image.convert("RGB")).astype(int)
        image.seek(8)
        last = np.asarray(image.convert("RGB")).astype(int)
    assert (np.abs(first - last) > 60).any(axis=-1).mean() > 0.01


def test_an_mp4_without_ffmpeg_is_refused_with_a_way_out(recording, tmp_path, monkeypatch):
    monkeypatch.setattr(motion.shutil, "which", lambda name: None)
    with pytest.raises(motion.MovieError, match="--animate gif"):
        draw(recording, tmp_path, animate="mp4")
    assert list(tmp_path.iterdir()) == []


def a_stand_in_for_ffmpeg(folder, monkeypatch, script):
    """Put a shell script named ffmpeg first on the path."""
    folder.mkdir()
    (folder / "ffmpeg").write_text(f"#!/bin/sh\n{script}\n")
    (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


@pytest.mark.slow
def test_an_mp4_is_made_of_all_pictures_at_their_rate(recording, tmp_path, monkeypatch):
    # The last word is the file to write; what comes in are raw pictures of three bytes a pixel.
    keep = f'echo "$@" > {tmp_path}/words; for last; do :; done; cat > "$last"'
    a_stand_in_for_ffmpeg(tmp_path / "bin", monkeypatch, keep)
    written = draw(recording, tmp_path / "p", animate="mp4")
    assert written[-1].name == "motion.mp4"
    words = (tmp_path / "words").read_text().split()
    width, height = map(int, words[words.index("-s") + 1].split("x"))
    assert float(words[words.index("-r") + 1]) == pytest.approx(20.0)
    assert written[-1].stat().st_size == 9 * width * height * 3


def test_a_failing_ffmpeg_is_told_and_leaves_no_file(recording, tmp_path, monkeypatch):
    fail = "cat > /dev/null; echo 'no such encoder' >&2; exit 1"
    a_stand_in_for_ffmpeg(tmp_path / "bin", monkeypatch, fail)
    track = surface_track(recording)
    with pytest.raises(motion.MovieError, match="no such encoder"):
        motion.save_motion(track, annotations_of(recording, track), tmp_path / "motion.mp4")
    assert not list(tmp_path.glob("*motion*"))


def test_a_picture_that_cannot_be_finished_leaves_no_file(recording, tmp_path, monkeypatch):
    def fail(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(motion, "_write_gif", fail)
    track = surface_track(recording)
    with pytest.raises(OSError):
        motion.save_motion(track, annotations_of(recording, track), tmp_path / "motion.gif")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("width", "inches"), [("column", 3.46), ("page", 7.09)])
def test_print_is_as_wide_as_a_column_or_a_page_with_letters_to_match(width, inches, recording, tmp_path):
    style = STYLES[width]
    written = draw(recording, tmp_path, style=style)
    for path in written:
        with Image.open(path) as image:
            assert image.width == pytest.approx(600 * inches, abs=2)
    figure = points_figure(
        point_tracks(recording, truth=True), {}, {}, title="No heading in print", style=style
    )
    assert not any("heading" in text.get_text() for text in figure.texts)
    sizes = {text.get_fontsize() for axes in figure.axes for text in axes.texts}
    assert min(sizes) >= 7.0


def test_nothing_of_a_printed_picture_is_cut_off(recording, tmp_path):
    for path in draw(recording, tmp_path, style=STYLES["column"], times=[0.0, 0.1, 0.2, 0.4]):
        image = pixels(path)
        edges = [image[:2], image[-2:], image[:, :2], image[:, -2:]]
        assert all((edge > 245).all() for edge in edges), path


@pytest.mark.slow
def test_vector_files_have_real_fonts_and_are_the_same_each_time(recording, tmp_path):
    first = draw(recording, tmp_path / "a", kind="pdf", style=STYLES["column"])
    again = draw(recording, tmp_path / "b", kind="pdf", style=STYLES["column"])
    assert [path.suffix for path in first] == [".pdf"] * 3
    for one, other in zip(first, again, strict=True):
        content = one.read_bytes()
        assert content == other.read_bytes()
        # Type 42 is an embedded TrueType font; publishers refuse Type 3.
        assert content.startswith(b"%PDF") and b"/Type3" not in content and b"/FontFile2" in content
    drawn = draw(recording, tmp_path / "c", kind="svg")
    assert b"<svg" in drawn[0].read_bytes()

"""Displacement of the named points against time: the true one as lines, the tracker's reports as dots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import AXIS_COLOURS, SOFT_INK, dress, heading, label_line_ends, new_figure
from ldcs_ros.plotting.tracks import Track

MM = 1e3


def points_figure(
    truth: Mapping[str, Track], measured: Mapping[str, Track], rest: Mapping[str, np.ndarray], *, title: str
) -> Figure:
    """Draw one panel a point with its displacement along x, y and z.

    Args:
        truth: Noise-free positions [m], shape (n, 3), by point.
        measured: Positions as the tracker reports them [m], shape (n, 3), by point.
        rest: Rest positions [m], shape (3,), by point; without one, a point's first position.
        title: Heading of the figure.
    """
    names = sorted({*truth, *measured})
    height = 2.5 * len(names) + 0.8
    figure = new_figure(6.8, height)
    grid = figure.add_gridspec(
        max(len(names), 1),
        1,
        left=0.11,
        right=0.86,
        bottom=0.5 / height,
        top=1.0 - 0.75 / height,
        hspace=0.25,
    )
    shared: Axes | None = None
    for number, name in enumerate(names):
        axes = figure.add_subplot(grid[number], sharex=shared)
        shared = shared or axes
        track = truth[name] if name in truth else measured[name]
        origin = rest.get(name, track.first)
        for which, colour in enumerate(AXIS_COLOURS.values()):
            if name in measured:
                dots = measured[name]
                height = MM * (dots.value[:, which] - origin[which])
                axes.plot(dots.time, height, ".", color=colour, markersize=2.2, alpha=0.35, zorder=1.5)
            if name in truth:
                line = truth[name]
                axes.plot(line.time, MM * (line.value[:, which] - origin[which]), color=colour, linewidth=1.7)
        axes.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
        last = number == len(names) - 1
        dress(axes, x_label="time [s]" if last else "", y_label="displacement [mm]", title=name)
        axes.tick_params(labelbottom=last)
        axes.margins(x=0.0, y=0.08)
        ends = MM * (track.last - origin)
        label_line_ends(
            axes,
            [
                (end, f"{axis}  {end:+.1f} mm", AXIS_COLOURS[axis])
                for axis, end in zip("xyz", ends, strict=True)
            ],
        )
    note = "lines: the state   dots: what the tracker reports" if truth and measured else ""
    heading(figure, title, note)
    return figure

"""Displacement of the named points against time: the true one as lines, the tracker's reports as dots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import (
    AXIS_COLOURS,
    SCREEN,
    SOFT_INK,
    FigureStyle,
    add_title,
    label_line_ends,
    stacked_axes,
    style_axes,
)
from ldcs_ros.signals.tracks import Track

MM = 1e3


def points_figure(
    truth: Mapping[str, Track],
    measured: Mapping[str, Track],
    rest: Mapping[str, np.ndarray],
    *,
    title: str,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Draw one panel a point with its displacement along x, y and z.

    Args:
        truth: Noise-free positions [m], shape (n, 3), by point.
        measured: Positions as the tracker reports them [m], shape (n, 3), by point.
        rest: Rest positions [m], shape (3,), by point; without one, a point's first position.
        title: Heading of the figure.
        style: Sizes.
    """
    names = sorted({*truth, *measured})
    figure, panels = stacked_axes(
        len(names),
        style,
        row=style.row,
        foot=3.8,
        head=5.7 if style.headed else 1.8,
        right=7.2,
        hspace=0.25,
    )
    for axes, name in zip(panels, names, strict=True):
        origin = rest.get(name, (truth if name in truth else measured)[name].first)
        _draw(axes, truth.get(name), measured.get(name), origin, style)
        x_label = "time [s]" if axes is panels[-1] else ""
        style_axes(axes, x_label=x_label, y_label="displacement [mm]", title=name, style=style)
    note = "lines: the state   dots: the tracker" if truth and measured else ""
    add_title(figure, title, note, style)
    return figure


def _draw(
    axes: Axes, truth: Track | None, measured: Track | None, origin: np.ndarray, style: FigureStyle
) -> None:
    labels = []
    for which, (axis, colour) in enumerate(AXIS_COLOURS.items()):
        end = 0.0
        if measured is not None:
            moved = MM * (measured.value[:, which] - origin[which])
            axes.plot(
                measured.time, moved, ".", color=colour, markersize=2.2 * style.scale, alpha=0.35, zorder=1.5
            )
            end = float(moved[-1])
        if truth is not None:
            moved = MM * (truth.value[:, which] - origin[which])
            # A line through a single time would be invisible.
            marker = "o" if len(moved) == 1 else ""
            axes.plot(truth.time, moved, color=colour, linewidth=1.7 * style.scale, marker=marker)
            end = float(moved[-1])
        labels.append((end, f"{axis}  {_signed(end)} mm", colour))
    axes.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
    axes.margins(x=0.0, y=0.08)
    label_line_ends(axes, labels, style=style)


def _signed(value: float) -> str:
    # Rounded first, so that a tiny negative number is no -0.0; with a true minus sign, as on the axis.
    rounded = round(value, 1)
    return f"{rounded:+.1f}".replace("-", "\N{MINUS SIGN}") if rounded else "0.0"

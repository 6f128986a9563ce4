"""Pictures around a rest state: its natural modes with their damping, and its sensitivities as bars."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from ldcs_ros.plotting.annotations import Annotations
from ldcs_ros.plotting.axes3d import MM, new_axes_3d
from ldcs_ros.plotting.style import (
    AXIS_COLOURS,
    INK,
    LINE_COLOURS,
    LOAD_COLOUR,
    SCREEN,
    SOFT_INK,
    FigureStyle,
    add_title,
    new_figure,
    style_axes,
)
from ldcs_ros.plotting.surface import add_displacement_key, common_frame, draw_surface
from ldcs_ros.simulation.linear_model import LinearModel
from ldcs_ros.simulation.sensitivity import StaticSensitivity

DRAWN = 6
"""Modes whose shapes are drawn, the lowest ones."""
_COLUMNS = 3
_PANEL = (3.1, 2.5)  # inches
_DAMPING = 2.4  # inches of the panel of the damping ratios
_FRACTION = 0.12  # largest displacement of a drawn mode, as a fraction of the sheet's longer side


def modes_figure(
    linear: LinearModel, rest: np.ndarray, annotations: Annotations, style: FigureStyle = SCREEN
) -> Figure:
    """Draw the lowest modes around a rest state, and the damping ratio of all modes of the model.

    Args:
        linear: The linear model around the rest state.
        rest: Its node positions [m], shape (2, nx, ny, 3); NaN in holes.
        annotations: Arms and loads of the scene.
        style: Sizes.
    """
    count = min(DRAWN, len(linear.frequencies))
    rows = math.ceil(count / _COLUMNS)
    factor = 1.0 if style.headed else style.width / (_PANEL[0] * _COLUMNS + 0.9)
    width, height = (factor * size for size in _PANEL)
    head = 0.45 if style.headed else style.inches(0.5)
    foot = factor * _DAMPING
    figure = new_figure(width * _COLUMNS + factor * 0.9, height * rows + foot + head)
    whole_width, whole_height = figure.get_size_inches()
    size = np.nanmax(np.ptp(annotations.rest.reshape(-1, 3), axis=0))
    shapes = [_FRACTION * size * _nodal(linear, k, rest.shape) for k in range(count)]
    # Displacements count from the rest state, not from the flat sheet.
    around = Annotations(
        annotations.title, rest, annotations.point_rest, annotations.driven, annotations.loads
    )
    frame = common_frame([rest + shape for shape in shapes], rest)
    for k, shape in enumerate(shapes):
        row, column = divmod(k, _COLUMNS)
        bottom = foot + (rows - row - 1) * height
        box = (
            column * width / whole_width,
            bottom / whole_height,
            width / whole_width,
            height / whole_height,
        )
        axes = new_axes_3d(figure, box)
        axes.patch.set_visible(False)
        draw_surface(axes, rest + shape, around, frame, large=False, style=style)
        # The amplitude of a mode is free, so millimetres mean nothing here.
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_major_locator(NullLocator())
            axis.set_label_text("")
        figure.text(
            (column + 0.5) * width / whole_width,
            (bottom + 0.97 * height) / whole_height,
            _label(linear, k),
            ha="center",
            va="top",
            fontsize=style.label,
            color=INK,
        )
    key = figure.add_axes(
        ((width * _COLUMNS + 0.1 * factor) / whole_width, (foot + 0.3 * height) / whole_height, 0.012, 0.3)
    )
    add_displacement_key(figure, key, frame, style)
    key.set_ylabel("displacement, scaled", fontsize=style.label, color=INK)
    key.yaxis.set_major_locator(NullLocator())
    _draw_damping(figure, linear, count, foot / whole_height, style)
    add_title(figure, annotations.title, "natural modes around the rest state", style)
    return figure


def _nodal(linear: LinearModel, mode: int, shape: tuple[int, ...]) -> np.ndarray:
    nodes: np.ndarray = linear.modes[mode][: math.prod(shape)].reshape(shape)
    return nodes


def _label(linear: LinearModel, mode: int) -> str:
    frequency, damping = linear.frequencies[mode], linear.damping[mode]
    if frequency < 0.0:
        return f"{mode + 1}: unstable, e-fold in {1.0 / (2.0 * math.pi * -frequency):.3g} s"
    return f"{mode + 1}: {frequency:.3g} Hz, damping ratio {damping:.2g}"


def _draw_damping(figure: Figure, linear: LinearModel, drawn: int, top: float, style: FigureStyle) -> None:
    axes = figure.add_axes((0.1, 0.25 * top, 0.82, 0.6 * top))
    stable = np.flatnonzero((linear.frequencies > 0.0) & (linear.damping > 0.0))
    axes.loglog(
        linear.frequencies[stable],
        linear.damping[stable],
        "o",
        color=LINE_COLOURS[0],
        markersize=4.5 * style.scale,
    )
    for k in stable[stable < drawn]:
        axes.annotate(
            f"{k + 1}",
            (linear.frequencies[k], linear.damping[k]),
            xytext=(0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=style.tick,
            color=SOFT_INK,
        )
    axes.axhline(1.0, color=LOAD_COLOUR, linewidth=0.8 * style.scale)
    axes.text(
        1.005,
        1.0,
        "critical",
        transform=axes.get_yaxis_transform(),
        va="center",
        fontsize=style.tick,
        color=LOAD_COLOUR,
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    style_axes(axes, x_label="natural frequency [Hz]", y_label="damping ratio", style=style)


def sensitivity_figure(found: StaticSensitivity, title: str) -> Figure:
    """Draw a group of bars for each number and a bar for each coordinate; lengths are fractions of the longest one.

    Numbers have units of their own, so each group has its own scale, which is written beside it.
    """
    count = len(found.to)
    rows = [
        k for k, row in enumerate(found.values) if np.any(np.abs(row) > 1e-9 * np.abs(found.values).max())
    ]
    points = list(dict.fromkeys(name[:-2] for name in found.rows))
    largest = np.abs(found.values).max(axis=0)
    figure = new_figure(7.5, 0.9 + count * (0.16 * len(rows) + 0.25))
    axes = figure.add_axes((0.36, 0.45 / figure.get_size_inches()[1] + 0.05, 0.44, 0.78))
    height = 0.8 / max(len(rows), 1)
    for number, row in enumerate(rows):
        lengths = found.values[row] / np.where(largest > 0.0, largest, 1.0)
        axes.barh(
            np.arange(count) + (number - 0.5 * (len(rows) - 1)) * height,
            lengths,
            height,
            label=found.rows[row],
            color=AXIS_COLOURS[found.rows[row][-1]],
            alpha=1.0 / (1 + points.index(found.rows[row][:-2])),  # further points are paler
        )
    axes.axvline(0.0, color=SOFT_INK, linewidth=0.6)
    axes.set_yticks(range(count), found.to, color=INK)
    for place, (value, unit) in enumerate(zip(largest, found.units, strict=True)):
        label = f"{MM * value:.3g} mm" + (f"/({unit})" if " " in unit else f"/{unit}" if unit else "")
        axes.text(1.04, place, label, va="center", color=SOFT_INK, fontsize=SCREEN.label - 1.0)
    axes.set_xlim(-1.02, 1.02)
    axes.invert_yaxis()
    style_axes(axes, x_label="fraction of the value at the right", y_label="")
    axes.legend(
        loc="upper right",
        bbox_to_anchor=(1.0, -0.09),
        ncols=len(rows),
        fontsize=SCREEN.label - 1.0,
        frameon=False,
    )
    add_title(figure, f"{title}: sensitivity at rest")
    return figure

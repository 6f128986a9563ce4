"""Sensitivities as bars: the move of each coordinate for a typical change of each number."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import (
    INK,
    LINE_COLOURS,
    SCREEN,
    SOFT_INK,
    add_title,
    new_figure,
    style_axes,
)
from ldcs_ros.simulation.sensitivity import StaticSensitivity

MM = 1e3


def sensitivity_figure(found: StaticSensitivity, title: str) -> Figure:
    """Draw a group of bars for each number and a bar for each coordinate; lengths are fractions of the longest one.

    Numbers have units of their own, so each group has its own scale, which is written beside it.
    """
    count = len(found.to)
    rows = [
        k for k, row in enumerate(found.values) if np.any(np.abs(row) > 1e-9 * np.abs(found.values).max())
    ]
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
            color=LINE_COLOURS[number % len(LINE_COLOURS)],
        )
    axes.axvline(0.0, color=SOFT_INK, linewidth=0.6)
    axes.set_yticks(range(count), found.to, color=INK)
    for place, (value, unit) in enumerate(zip(largest, found.units, strict=True)):
        label = f"{MM * value:.3g} mm" + (f"/({unit})" if unit else "")
        axes.text(1.04, place, label, va="center", color=SOFT_INK, fontsize=SCREEN.label - 1.0)
    axes.set_xlim(-1.02, 1.02)
    axes.invert_yaxis()
    style_axes(axes, x_label="fraction of the value at the right", y_label="")
    axes.legend(loc="lower right", fontsize=SCREEN.label - 1.0, frameon=False)
    add_title(figure, f"{title}: sensitivity at rest")
    return figure

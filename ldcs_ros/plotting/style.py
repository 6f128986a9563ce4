"""One look for all pictures: colours, fonts, and how a figure is made and saved without pyplot's state."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart by colour-blind readers and in print.
AXIS_COLOURS = {"x": "#0072B2", "y": "#009E73", "z": "#D55E00"}
LINE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
INK = "#262626"
SOFT_INK = "#6b6b6b"
GRID = "#e3e3e3"
LOAD_COLOUR = "#B2182B"
# Viridis without its darkest end, where black arms would not show.
SURFACE_MAP = LinearSegmentedColormap.from_list("surface", colormaps["viridis"](np.linspace(0.22, 1.0, 256)))

TITLE_SIZE = 11.0
LABEL_SIZE = 9.5
TICK_SIZE = 8.5


def new_figure(width: float, height: float, *, dpi: int = 150) -> Figure:
    """Return an empty figure of a size in inches, drawn by Agg."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def dress(axes: Axes, *, x_label: str, y_label: str, title: str = "") -> None:
    """Give flat axes the common look: two spines, a light grid behind the lines, labels with units."""
    axes.set_title(title, fontsize=TITLE_SIZE, color=INK, loc="left", fontweight="bold")
    axes.set_xlabel(x_label, fontsize=LABEL_SIZE, color=INK)
    axes.set_ylabel(y_label, fontsize=LABEL_SIZE, color=INK)
    axes.tick_params(labelsize=TICK_SIZE, colors=SOFT_INK)
    axes.set_axisbelow(True)
    axes.grid(True, color=GRID, linewidth=0.7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(SOFT_INK)


def heading(figure: Figure, title: str, note: str = "") -> None:
    """Write the figure's title at its upper left, and a note in small print under it."""
    height = figure.get_figheight()
    left = 0.15 / figure.get_figwidth()
    # A bold letter is about 0.66 of its size wide, and a point is 1/72 inch: a long title is written smaller.
    widest = 72.0 * (figure.get_figwidth() - 0.3) / (0.66 * max(len(title), 1))
    size = min(TITLE_SIZE, widest)
    figure.text(left, 1.0 - 0.12 / height, title, fontsize=size, color=INK, fontweight="bold", va="top")
    figure.text(left, 1.0 - 0.34 / height, note, fontsize=TICK_SIZE, color=SOFT_INK, va="top")


def label_line_ends(axes: Axes, labels: list[tuple[float, str, Any]], *, gap: float = 0.075) -> None:
    """Write each line's name and last value to the right of the axes, pushed apart so that none overlap.

    Args:
        axes: Axes whose limits are final.
        labels: (height in data units, text, colour) of each line.
        gap: Smallest distance of two labels, as a share of the axes' height.
    """
    low, high = axes.get_ylim()
    placed: list[float] = []
    for height, text, colour in sorted(labels, key=lambda label: label[0]):
        share = (height - low) / (high - low)
        share = max(share, placed[-1] + gap) if placed else max(share, 0.0)
        placed.append(share)
        axes.text(
            1.01,
            share,
            text,
            transform=axes.transAxes,
            color=colour,
            fontsize=LABEL_SIZE,
            va="center",
            ha="left",
        )


def save_png(figure: Figure, path: Path) -> Path:
    """Write a figure; the file appears whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        figure.savefig(partial, format="png", facecolor="white")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path

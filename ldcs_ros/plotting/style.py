"""The style of all pictures: colours, fonts, sizes for screen and print; figures are made and saved here."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

# Okabe and Ito's palette: distinguishable for colour-blind readers and in print.
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


@dataclass(frozen=True)
class FigureStyle:
    """Sizes that belong together.

    Attributes:
        width: Width of a picture of curves [inch].
        row: Height of one of its panels [inch].
        title: Size of titles [pt].
        label: Size of labels [pt].
        tick: Size of the numbers at the axes [pt].
        scale: Factor of the thickness of lines and the size of dots.
        headed: Whether figures have a heading; in print the caption replaces it.
    """

    width: float
    row: float
    title: float
    label: float
    tick: float
    scale: float
    headed: bool

    def inches(self, lines: float) -> float:
        """Return the height of some lines of labels, or the width of twice as many letters [inch]."""
        return lines * self.label / 72.0


SCREEN = FigureStyle(6.8, 2.5, TITLE_SIZE, LABEL_SIZE, TICK_SIZE, 1.0, True)
# One column and the full width of a page of two, 88 and 180 mm, as most journals have them.
COLUMN = FigureStyle(3.46, 1.35, 8.0, 7.5, 7.0, 0.65, False)
PAGE = FigureStyle(7.09, 1.6, 8.0, 7.5, 7.0, 0.65, False)
STYLES = {"screen": SCREEN, "column": COLUMN, "page": PAGE}
_PRINT_DPI = 600
_NO_DATE = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


def new_figure(width: float, height: float, *, dpi: int = 150) -> Figure:
    """Return an empty figure of a size in inches, drawn by Agg."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def stacked_axes(
    count: int,
    style: FigureStyle,
    *,
    row: float,
    foot: float,
    head: float,
    right: float,
    hspace: float,
) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels under each other that share their time axis, labelled at the lowest alone.

    Args:
        count: Number of panels.
        style: Sizes.
        row: Height of a panel [inch].
        foot: Lines of labels below the panels.
        head: Lines of labels above the panels.
        right: Lines of labels at the right of the panels.
        hspace: Height between panels, as a fraction of a panel.
    """
    below, above = style.inches(foot), style.inches(head)
    height = row * count + (0.8 if style.headed else below + above)
    figure = new_figure(style.width, height)
    grid = figure.add_gridspec(
        max(count, 1),
        1,
        left=style.inches(5.67) / style.width,
        right=1.0 - style.inches(right) / style.width,
        bottom=below / height,
        top=1.0 - above / height,
        hspace=hspace,
    )
    panels: list[Axes] = []
    for number in range(count):
        panels.append(figure.add_subplot(grid[number], sharex=panels[0] if panels else None))
        panels[-1].tick_params(labelbottom=number == count - 1)
    return figure, panels


def style_axes(
    axes: Axes, *, x_label: str, y_label: str, title: str = "", style: FigureStyle = SCREEN
) -> None:
    """Give flat axes the common look: two spines, a light grid behind the lines, labels with units."""
    pad: dict[str, Any] = {} if style.headed else {"pad": 3.0}
    axes.set_title(title, fontsize=style.title, color=INK, loc="left", fontweight="bold", **pad)
    axes.set_xlabel(x_label, fontsize=style.label, color=INK)
    axes.set_ylabel(y_label, fontsize=style.label, color=INK)
    axes.tick_params(labelsize=style.tick, colors=SOFT_INK, length=3.5 * style.scale)
    axes.set_axisbelow(True)
    axes.grid(True, color=GRID, linewidth=0.7)
    for spine in axes.spines.values():
        spine.set_linewidth(0.8 * style.scale)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(SOFT_INK)


def add_title(figure: Figure, title: str, note: str = "", style: FigureStyle = SCREEN) -> None:
    """Write the figure's title at its upper left, and a note in small print under it; nothing in print."""
    if not style.headed:
        return
    height = figure.get_figheight()
    left = 0.15 / figure.get_figwidth()
    # A bold letter is about 0.66 of its size wide, and a point is 1/72 inch: a long title is written smaller.
    widest = 72.0 * (figure.get_figwidth() - 0.3) / (0.66 * max(len(title), 1))
    size = min(TITLE_SIZE, widest)
    figure.text(left, 1.0 - 0.12 / height, title, fontsize=size, color=INK, fontweight="bold", va="top")
    figure.text(left, 1.0 - 0.34 / height, note, fontsize=TICK_SIZE, color=SOFT_INK, va="top")


def label_line_ends(axes: Axes, labels: list[tuple[float, str, str]], *, style: FigureStyle = SCREEN) -> None:
    """Write each line's name and last value to the right of the axes, pushed apart so that none overlap.

    Args:
        axes: Axes whose limits are final.
        labels: (height in data units, text, colour) of each line.
        style: Sizes, which give the smallest distance of two labels.
    """
    gap = 1.25 * style.inches(1.0) / (axes.bbox.height / axes.figure.dpi)
    low, high = axes.get_ylim()
    placed: list[float] = []
    for height, text, colour in sorted(labels, key=lambda label: label[0]):
        fraction = (height - low) / (high - low)
        fraction = max(fraction, placed[-1] + gap) if placed else max(fraction, 0.0)
        placed.append(fraction)
        axes.text(
            1.01,
            fraction,
            text,
            transform=axes.transAxes,
            color=colour,
            fontsize=style.label,
            va="center",
            ha="left",
        )


def save_figure(figure: Figure, path: Path, style: FigureStyle = SCREEN) -> Path:
    """Write a figure in the format of its ending; the file appears whole or not at all.

    Vector files hold real fonts, as publishers ask for, and no date: the same bag gives the same file.
    """
    kind = path.suffix[1:]
    partial = path.with_name(f".{path.name}.partial")
    options: dict[str, Any] = {"metadata": _NO_DATE[kind]} if kind in _NO_DATE else {}
    if not style.headed:
        options["dpi"] = _PRINT_DPI
    try:
        with rc_context({"pdf.fonttype": 42, "svg.hashsalt": "ldcs"}):
            figure.savefig(partial, format=kind, facecolor="white", **options)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path

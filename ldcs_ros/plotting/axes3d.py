"""Axes in 3D of the surface pictures: one view, flat panes, equal scales in mm, and the key of the colours."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D

from ldcs_ros.plotting.style import GRID, INK, SCREEN, SOFT_INK, FigureStyle

MM = 1e3
ELEVATION, AZIMUTH = 28.0, -125.0  # from the clamp: the bent side and both arms are visible
MIN_HEIGHT = 0.35  # of the length: a flat sheet still needs height for its loads and a readable z axis


def new_axes_3d(figure: Figure, box: tuple[float, float, float, float]) -> Axes3D:
    """Return 3D axes with a light grid in a box (left, bottom, width, height), fractions of the figure."""
    with rc_context({"grid.color": GRID, "grid.linewidth": 0.6}):
        return figure.add_axes(box, projection="3d", computed_zorder=False)


def style_axes_3d(axes: Axes3D, low: np.ndarray, high: np.ndarray, *, zoom: float, label_size: float) -> None:
    """Give 3D axes the common look and the limits of a box [mm], shape (3,) each."""
    for limits, first, last in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        limits(first, last)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.view_init(elev=ELEVATION, azim=AZIMUTH)
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color(SOFT_INK)
        axis.set_label_text(f"{name} [mm]", fontsize=label_size, color=INK)
    axes.zaxis.set_rotate_label(False)
    axes.zaxis.label.set_rotation(90)


def quads(layer: np.ndarray) -> np.ndarray:
    """Return the corners of the cells of a layer of nodes, shape (nx, ny, 3), as shape (n_cells, 4, 3)."""
    corners = [layer[:-1, :-1], layer[1:, :-1], layer[1:, 1:], layer[:-1, 1:]]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def cell_means(value: np.ndarray) -> np.ndarray:
    """Return the mean of a nodal value, shape (nx, ny), over each cell, shape (n_cells,)."""
    mean: np.ndarray = 0.25 * (value[:-1, :-1] + value[1:, :-1] + value[1:, 1:] + value[:-1, 1:]).ravel()
    return mean


def add_colour_bar(
    figure: Figure, axes: Axes, colours: ScalarMappable, label: str, style: FigureStyle = SCREEN
) -> Colorbar:
    """Draw the key of the colours into axes of its own."""
    bar = figure.colorbar(colours, cax=axes)
    bar.set_label(label, fontsize=style.label, color=INK)
    bar.ax.tick_params(labelsize=style.tick, colors=SOFT_INK, length=2)
    bar.outline.set_visible(False)
    return bar

"""The surface's error as a picture: the sheet at its worst moment, a map over its nodes, and its course in time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ldcs_ros.compare.field import FieldDifference
from ldcs_ros.compare.words import figure, scale
from ldcs_ros.plotting.style import (
    GRID,
    INK,
    LINE_COLOURS,
    PAGE,
    SCREEN,
    SOFT_INK,
    Look,
    dress,
    heading,
    new_figure,
)

ERROR_MAP = "magma_r"


class _Left(NamedTuple):
    """Where the parts begin, as shares of the picture's width."""

    sheet: float
    key: float
    plan: float
    plan_key: float
    course: float


_ON_SCREEN = _Left(0.0, 0.355, 0.46, 0.632, 0.755)
_IN_PRINT = _Left(0.0, 0.345, 0.47, 0.627, 0.79)
_WITHOUT_HEADING = 1.12  # what is below the heading fills its place
_VIEW = {"elev": 28.0, "azim": -125.0}  # as in the pictures of the surface itself


def surface_figure(surface: FieldDifference, a: str, b: str, look: Look = SCREEN) -> Figure:
    """Draw the distance of the nodes of one recording from where the other has them.

    Args:
        surface: The difference.
        a, b: Names of the recordings.
        look: Sizes; in print it is always as wide as a page.
    """
    # Its parts stand where they do whatever the size; letters shrink less than the picture does.
    whole = new_figure(11.4, 4.0) if look.headed else new_figure(PAGE.width, 0.32 * PAGE.width)
    unit, factor = scale(surface.figures.max, "m")
    distance = factor * surface.distance[surface.worst]
    time = float(surface.time[surface.worst])
    norm = Normalize(0.0, max(float(distance.max()), 1e-12))
    left = _ON_SCREEN if look.headed else _IN_PRINT
    up = 1.0 if look.headed else _WITHOUT_HEADING
    sheet: Any = whole.add_axes((left.sheet, 0.02, 0.35, 0.80 * up), projection="3d")
    _draw_sheet(sheet, 1e3 * surface.place[1], distance[1], norm, look)
    bar = whole.colorbar(
        ScalarMappable(norm=norm, cmap=ERROR_MAP), cax=whole.add_axes((left.key, 0.2 * up, 0.009, 0.5 * up))
    )
    _dress_bar(bar, f"distance [{unit}]", look)
    _caption(whole, max(left.sheet, 0.02), f"worst moment, t = {time:.3f} s, top layer", look)
    plan = whole.add_axes((left.plan, 0.16 * up, left.plan_key - left.plan - 0.007, 0.60 * up))
    image = _draw_map(plan, factor * surface.rms_over_time, look)
    bar = whole.colorbar(image, cax=whole.add_axes((left.plan_key, 0.2 * up, 0.009, 0.5 * up)))
    _dress_bar(bar, f"RMS over time [{unit}]", look)
    _caption(whole, left.plan, "every node, over all moments", look)
    course = whole.add_axes((left.course, 0.16 * up, 0.99 - left.course, 0.60 * up))
    _draw_course(course, surface, factor, unit, look)
    _caption(whole, left.course, "all nodes, against time", look)
    found = surface.figures
    note = (
        f"RMS {figure(factor * found.rms)} {unit}, 95 % below {figure(factor * found.p95)} {unit}, "
        f"at most {figure(factor * found.max)} {unit}"
    )
    heading(whole, f"Surface: {a} against {b}", note, look)
    return whole


def _draw_sheet(axes: Any, place: np.ndarray, distance: np.ndarray, norm: Normalize, look: Look) -> None:
    corners = [place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]]
    quads = np.stack(corners, axis=2).reshape(-1, 4, 3)
    mean = 0.25 * (distance[:-1, :-1] + distance[1:, :-1] + distance[1:, 1:] + distance[:-1, 1:])
    colours = ScalarMappable(norm=norm, cmap=ERROR_MAP).to_rgba(mean.ravel())
    axes.add_collection3d(
        Poly3DCollection(quads, facecolors=colours, edgecolors=SOFT_INK, linewidths=0.4 * look.scale)
    )
    low, high = place.min(axis=(0, 1)), place.max(axis=(0, 1))
    high[2] = max(high[2], low[2] + 0.35 * (high[0] - low[0]))
    for limits, one, two in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        limits(one, two)
    axes.set_box_aspect(high - low, zoom=0.95)
    axes.view_init(**_VIEW)
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color(SOFT_INK)
        axis._axinfo["grid"].update(color=GRID, linewidth=0.6)
        axis.set_label_text(f"{name} [mm]", fontsize=look.label - 1.0, color=INK)
        axis.labelpad = -4.0 if look.headed else -8.0
    axes.zaxis.set_rotate_label(False)
    axes.zaxis.label.set_rotation(90)
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize=look.tick - 1.5, colors=SOFT_INK, pad=-3 if look.headed else -4.5)


def _draw_map(axes: Axes, rms: np.ndarray, look: Look) -> Any:
    nx, ny = rms.shape
    top = max(float(rms.max()), 1e-12)
    extent = (-0.5, nx - 0.5, -0.5, ny - 0.5)
    image = axes.imshow(
        rms.T, origin="lower", extent=extent, cmap=ERROR_MAP, vmin=0.0, vmax=top, aspect="equal"
    )
    axes.set_xlabel("node i, from the clamp to the free edge", fontsize=look.label - 1.0, color=INK)
    axes.set_ylabel("node j", fontsize=look.label - 1.0, color=INK)
    axes.tick_params(labelsize=look.tick, colors=SOFT_INK, length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    return image


def _draw_course(axes: Axes, surface: FieldDifference, factor: float, unit: str, look: Look) -> None:
    largest = surface.distance.max(axis=(1, 2, 3))
    marker = "o" if len(surface.time) == 1 else ""
    axes.plot(
        surface.time,
        factor * largest,
        color=LINE_COLOURS[1],
        linewidth=1.3 * look.scale,
        marker=marker,
        label="largest",
    )
    axes.plot(
        surface.time,
        factor * surface.rms_over_nodes,
        color=LINE_COLOURS[0],
        linewidth=1.6 * look.scale,
        marker=marker,
        label="RMS",
    )
    dress(axes, x_label="time [s]", y_label=f"distance [{unit}]", look=look)
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.01)
    axes.legend(
        fontsize=look.label,
        frameon=False,
        loc="lower right",
        bbox_to_anchor=(1.02, 0.98),
        ncol=2,
        borderpad=0.0,
    )


def _dress_bar(bar: Any, label: str, look: Look) -> None:
    bar.set_label(label, fontsize=look.label, color=INK)
    bar.ax.tick_params(labelsize=look.tick, colors=SOFT_INK, length=2)
    bar.outline.set_visible(False)


def _caption(figure: Figure, left: float, text: str, look: Look) -> None:
    height = 0.82 if look.headed else 0.82 * _WITHOUT_HEADING
    figure.text(left, height, text, fontsize=look.label, color=INK, va="bottom")

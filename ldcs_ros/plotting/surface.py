"""The deformed sheet in 3D at chosen times: both layers, arms in black, loads marked, equal axes in mm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from ldcs_ros.physics.points import Stencil
from ldcs_ros.plotting.annotations import Annotations
from ldcs_ros.plotting.axes3d import (
    MIN_HEIGHT,
    MM,
    add_colour_bar,
    cell_means,
    new_axes_3d,
    quads,
    style_axes_3d,
)
from ldcs_ros.plotting.style import (
    INK,
    LOAD_COLOUR,
    SCREEN,
    SOFT_INK,
    SURFACE_MAP,
    FigureStyle,
    add_title,
    new_figure,
)

# Fraction of a panel by which its box is raised: seen from above, the drawing is low in its box.
_LIFT = 0.09
_ARROW_LENGTH = 26.0  # mm
_LABEL_LIFT = 6.0  # mm above the place of a load


@dataclass(frozen=True)
class ViewBox:
    """The box and the colour scale common to all panels of a figure, or all frames of a motion.

    Attributes:
        low, high: Corners of the drawn box [mm], shape (3,).
        scale: Displacement to colour, in mm.
    """

    low: np.ndarray
    high: np.ndarray
    scale: Normalize


def common_frame(positions: Sequence[np.ndarray], rest: np.ndarray) -> ViewBox:
    """Return the box and the colour scale that hold all the positions [m], shape (2, nx, ny, 3) each."""
    everything = MM * np.stack([*positions, rest])
    low, high = np.nanmin(everything, axis=(0, 1, 2, 3)), np.nanmax(everything, axis=(0, 1, 2, 3))
    margin = 0.04 * float((high - low).max())
    low, high = low - margin, high + margin
    high[2] = max(high[2], low[2] + MIN_HEIGHT * (high[0] - low[0]))
    moved = np.linalg.norm(everything[:-1] - everything[-1], axis=-1)
    largest = max(float(np.max(moved, initial=1e-3, where=np.isfinite(moved))), 1e-3)
    return ViewBox(low, high, Normalize(0.0, largest))


def surface_figure(
    positions: Sequence[np.ndarray],
    times: Sequence[float],
    annotations: Annotations,
    style: FigureStyle = SCREEN,
) -> Figure:
    """Draw the sheet at several times with common axes and colours.

    Args:
        positions: Node positions [m], shape (2, nx, ny, 3) each.
        times: Their times [s].
        annotations: Rest shape, arms and loads of the scene.
        style: Sizes.
    """
    count = len(positions)
    large = count == 1
    columns = _columns(count, style)
    rows = math.ceil(count / columns)
    # Inches of one panel, of the colour key at the right and of the heading.
    if style.headed:
        width, height = (6.3, 4.9) if large else (3.5, 2.9)
        key, head, margin = 0.95, 0.5 if large else 0.4, 0.0
    else:
        key, head, margin = style.inches(6.2), style.inches(0.5), style.inches(0.7)
        width = (style.width - key - margin) / columns
        height = (0.78 if large else 0.83) * width
    figure = new_figure(margin + width * columns + key, height * rows + head)
    whole_width, whole_height = figure.get_size_inches()
    frame = common_frame(positions, annotations.rest)
    for number, (position, time) in enumerate(zip(positions, times, strict=True)):
        row, column = divmod(number, columns)
        bottom = whole_height - head - (row + 1) * height + _LIFT * height
        box = (
            (margin + column * width) / whole_width,
            bottom / whole_height,
            width / whole_width,
            height / whole_height,
        )
        axes = new_axes_3d(figure, box)
        axes.patch.set_visible(False)  # it would cover the labels of the panel above
        draw_surface(axes, position, annotations, frame, large=large, style=style)
        if not large or not style.headed:
            stamp: dict[str, Any] = {"fontsize": style.label, "color": INK, "ha": "center", "va": "top"}
            letter = f"({chr(ord('a') + number)})  " if count > 1 and not style.headed else ""
            top = min(box[1] + 0.93 * box[3], 1.0 - style.inches(0.3) / whole_height)
            place = (box[0] + 0.5 * box[2], top)
            figure.text(*place, f"{letter}t = {time:.2f} s", **stamp)
    add_title(figure, annotations.title, f"t = {times[0]:.2f} s" if large else "", style)
    tall = min(2.6, 0.6 * height * rows)
    left, bottom = (
        (whole_width - key + style.inches(0.9)) / whole_width,
        0.5 * (whole_height - head - tall) / whole_height,
    )
    place_of_key = figure.add_axes((left, bottom, style.inches(1.0) / whole_width, tall / whole_height))
    add_displacement_key(figure, place_of_key, frame, style)
    return figure


def _columns(count: int, style: FigureStyle) -> int:
    """Return the number of panels in a row: rows are full and letters legible."""
    most = 4 if style.headed or style.width > 5.0 else 2
    return count if count <= min(most, 3) else math.ceil(count / math.ceil(count / most))


def add_displacement_key(figure: Figure, axes: Axes, frame: ViewBox, style: FigureStyle = SCREEN) -> None:
    """Draw the key of the displacements."""
    colours = ScalarMappable(norm=frame.scale, cmap=SURFACE_MAP)
    add_colour_bar(figure, axes, colours, "displacement [mm]", style)


def draw_surface(
    axes: Axes3D,
    position: np.ndarray,
    annotations: Annotations,
    frame: ViewBox,
    *,
    large: bool,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw one state of the sheet [m], shape (2, nx, ny, 3), into 3D axes."""
    place = MM * position
    moved = np.linalg.norm(MM * (position - annotations.rest), axis=-1)
    _draw_shadow(axes, place[0], floor=float(frame.low[2]))
    _draw_sheet(axes, place, moved, frame.scale, style)
    _draw_arms(axes, place, annotations.driven, large=large, style=style)
    _draw_loads(axes, place, annotations, large=large, style=style)
    _style_axes(axes, frame, large=large, style=style)


def _draw_shadow(axes: Axes3D, layer: np.ndarray, *, floor: float) -> None:
    flat = layer.copy()
    flat[..., 2] = floor
    cells = quads(flat)
    cells = cells[np.isfinite(cells).all(axis=(1, 2))]
    axes.add_collection3d(Poly3DCollection(cells, facecolors="#ececec", edgecolors="none", zorder=1))


def _draw_sheet(
    axes: Axes3D, place: np.ndarray, moved: np.ndarray, scale: Normalize, style: FigureStyle
) -> None:
    bottom, top = place
    polygons: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    edges: list[tuple[float, float, float, float]] = []
    for layer, shift, dim in ((top, moved[1], 1.0), (bottom, moved[0], 0.72)):
        cells = quads(layer)
        shade = _shade(cells) * dim
        paint = SURFACE_MAP(scale(cell_means(shift)))
        paint[:, :3] *= shade[:, None]
        polygons += list(cells)
        faces += list(paint)
        edges += [to_rgba("white", 0.55)] * len(cells)
    for rim in (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]):
        walls = _walls(bottom[rim], top[rim])
        shift = moved.mean(axis=0)[rim]
        paint = SURFACE_MAP(scale(0.5 * (shift[1:] + shift[:-1])))
        paint[:, :3] *= 0.6
        polygons += list(walls)
        faces += list(paint)
        edges += [to_rgba("white", 0.4)] * len(walls)
    # Cells at a node that was not measured are left out.
    drawn = [k for k, polygon in enumerate(polygons) if np.isfinite(polygon).all()]
    # One collection, so that matplotlib sorts layers and walls by depth together.
    axes.add_collection3d(
        Poly3DCollection(
            [polygons[k] for k in drawn],
            facecolors=[faces[k] for k in drawn],
            edgecolors=[edges[k] for k in drawn],
            linewidths=0.5 * style.scale,
            zorder=2,
            zsort="average",
        )
    )


def _walls(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    return np.stack([lower[:-1], lower[1:], upper[1:], upper[:-1]], axis=1)


def _shade(cells: np.ndarray) -> np.ndarray:
    """Return the brightness of each quad under one lamp, 0.72 to 1, shape (n,)."""
    normal = np.cross(cells[:, 2] - cells[:, 0], cells[:, 3] - cells[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    lamp = np.array([-0.45, -0.35, 0.82])
    shade: np.ndarray = 0.72 + 0.28 * np.clip(np.abs(normal @ lamp), 0.0, 1.0)
    return shade


def _draw_arms(
    axes: Axes3D,
    place: np.ndarray,
    lines: tuple[tuple[Stencil, ...], ...],
    *,
    large: bool,
    style: FigureStyle,
) -> None:
    # Lines over everything: the far arm would vanish behind the sheet's rim.
    options: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round", "zorder": 3}
    nodes = place.reshape(-1, 3)
    for line in lines:
        x, y, z = np.array([point.mean(nodes) for point in line]).T
        axes.plot(x, y, z, color="black", linewidth=(4.0 if large else 2.4) * style.scale, **options)


def _draw_loads(
    axes: Axes3D, place: np.ndarray, annotations: Annotations, *, large: bool, style: FigureStyle
) -> None:
    halo = [withStroke(linewidth=2.5 * style.scale, foreground="white")]
    for load in (one for one in annotations.loads if one.mass > 0.0 or one.force.any()):
        spot = load.point.position(place.reshape(-1, 3))
        dot = {
            "s": (75 if large else 34) * style.scale**2,
            "edgecolors": "white",
            "linewidths": 0.9 * style.scale,
            "depthshade": False,
        }
        axes.scatter(*spot, color=LOAD_COLOUR, zorder=5, **dot)
        size = float(np.linalg.norm(load.force))
        label = f"{1e3 * load.mass:g} g" if load.mass > 0.0 else f"{size:g} N"
        if load.mass == 0.0:
            arrow = _ARROW_LENGTH * load.force / size
            axes.quiver(
                *spot,
                *arrow,
                color=LOAD_COLOUR,
                linewidth=2.0 * style.scale,
                arrow_length_ratio=0.3,
                zorder=5,
            )
        lift = spot + [0.0, 0.0, _LABEL_LIFT]
        axes.text(
            *lift,
            label,
            color=LOAD_COLOUR,
            fontsize=style.label if style.headed or large else style.label - 1.0,
            ha="center",
            zorder=6,
            path_effects=halo,
        )


def _style_axes(axes: Axes3D, frame: ViewBox, *, large: bool, style: FigureStyle) -> None:
    zoom = (1.08 if large else 0.95) * (1.0 if style.headed else 0.9)
    size = style.label if large else style.label - 1.0
    style_axes_3d(axes, frame.low, frame.high, zoom=zoom, label_size=size)
    axes.set_proj_type("persp", focal_length=0.35)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(nbins=4 if style.headed else 3, steps=[1, 2, 5, 10]))
        axis.labelpad = _pad((2.0, -5.0), (-8.0, -9.5), large, style)
    axes.tick_params(
        labelsize=style.tick if large else style.tick - 1.5,
        colors=SOFT_INK,
        pad=_pad((0.0, -3.0), (-4.0, -5.0), large, style),
    )


def _pad(screen: tuple[float, float], printed: tuple[float, float], large: bool, style: FigureStyle) -> float:
    """Return the distance of a label from its axis [pt], large or not; matplotlib's own suits larger pictures."""
    return (screen if style.headed else printed)[0 if large else 1]

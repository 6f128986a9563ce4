"""The workspace of a point from the side, from the front and from above."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.plotting.axes3d import MM
from ldcs_ros.plotting.style import (
    INK,
    LINE_COLOURS,
    LOAD_COLOUR,
    SCREEN,
    FigureStyle,
    add_title,
    new_figure,
    style_axes,
)
from ldcs_ros.reach.workspace import Workspace

_VIEWS = ((0, 2), (1, 2), (0, 1))
_MOST_LINES = 2  # commands whose grid is drawn as lines


def workspace_figure(found: Workspace, flat: np.ndarray, title: str, style: FigureStyle = SCREEN) -> Figure:
    """Draw the views from the side, from the front and from above.

    Lines have all commands but one fixed. Beyond two commands the rest positions are dots.

    Args:
        found: The workspace.
        flat: Place of the point on the flat sheet [m], shape (3,).
        title: Title of the scene.
        style: Sizes.
    """
    count = len(found.variables)
    figure = new_figure(style.width * (1.5 if style.headed else 1.0), style.row * 1.5)
    panels = [figure.add_axes((0.07 + 0.32 * k, 0.2, 0.25, 0.62)) for k in range(len(_VIEWS))]
    for axes, (across, up) in zip(panels, _VIEWS, strict=True):
        place = MM * found.position[..., [across, up]]
        if count <= _MOST_LINES:
            _draw_lines(axes, place, found, style)
        else:
            dots = place.reshape(-1, 2)
            axes.plot(dots[:, 0], dots[:, 1], ".", color=LINE_COLOURS[0], markersize=3.0 * style.scale)
        axes.plot(*(MM * flat[[across, up]]), "+", color=LOAD_COLOUR, label="flat sheet")
        # The y range is often a hundredth of the others: only the view from the side has equal scales.
        if (across, up) == (0, 2):
            axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        names = "xyz"
        style_axes(axes, x_label=f"{names[across]} [mm]", y_label=f"{names[up]} [mm]", style=style)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="lower center",
        ncols=len(labels),
        fontsize=style.label - 1.0,
        frameon=False,
        labelcolor=INK,
    )
    low, high = found.extent
    spans = ", ".join(
        f"{axis} {MM * a:.1f} to {MM * b:.1f} mm" for axis, a, b in zip("xyz", low, high, strict=True)
    )
    add_title(figure, f"{title}: where {found.place} rests", spans, style)
    return figure


def _draw_lines(axes: Axes, place: np.ndarray, found: Workspace, style: FigureStyle) -> None:
    for k, variable in enumerate(found.variables):
        lines = np.moveaxis(place, k, 0).reshape(found.levels, -1, 2)
        label = f"{variable.name} from {variable.low:g} to {variable.high:g}"
        for number in range(lines.shape[1]):
            axes.plot(
                lines[:, number, 0],
                lines[:, number, 1],
                color=LINE_COLOURS[k],
                linewidth=0.9 * style.scale,
                label=label if number == 0 else None,
            )

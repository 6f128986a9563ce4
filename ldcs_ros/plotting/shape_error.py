"""A rest state beside a map of its heights above the shape that was asked for."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ldcs_ros.plotting.annotations import Annotations
from ldcs_ros.plotting.axes3d import MM, add_colour_bar, new_axes_3d
from ldcs_ros.plotting.style import SCREEN, FigureStyle, add_title, new_figure, style_axes
from ldcs_ros.plotting.surface import common_frame, draw_surface


def shape_error_figure(
    rest: np.ndarray, error: np.ndarray, annotations: Annotations, note: str, style: FigureStyle = SCREEN
) -> Figure:
    """Draw the sheet and its vertical distance to the shape.

    Args:
        rest: Node positions [m], shape (2, nx, ny, 3); NaN in holes.
        error: Height of each place above the shape [m], shape (nx, ny); NaN where none is asked.
        annotations: Rest shape, arms and loads of the scene.
        note: Text under the title.
        style: Sizes.
    """
    width = style.width * (1.4 if style.headed else 1.0)
    figure = new_figure(width, 0.5 * width)
    axes = new_axes_3d(figure, (0.0, 0.0, 0.54, 0.9))
    draw_surface(axes, rest, annotations, common_frame([rest], annotations.rest), large=True, style=style)
    flat = MM * annotations.rest[0]
    largest = MM * float(np.nanmax(np.abs(error)))
    scale, colours = Normalize(-largest, largest), colormaps["RdBu_r"]
    plane = figure.add_axes((0.61, 0.17, 0.27, 0.62))
    plane.pcolormesh(
        flat[..., 0], flat[..., 1], MM * error, cmap=colours, norm=scale, shading="nearest", rasterized=True
    )
    plane.set_aspect("equal", adjustable="box")
    style_axes(plane, x_label="x on the flat sheet [mm]", y_label="y [mm]", style=style)
    key = figure.add_axes((0.905, 0.25, 0.014, 0.46))
    add_colour_bar(figure, key, ScalarMappable(scale, colours), "height above the shape [mm]", style)
    add_title(figure, annotations.title, note, style)
    return figure

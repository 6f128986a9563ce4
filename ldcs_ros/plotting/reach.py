"""Pictures of inverse statics: the workspace of a point, a rest state beside a shape, a course of commands."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ldcs_ros.plotting.annotations import Annotations
from ldcs_ros.plotting.axes3d import MM, add_colour_bar, new_axes_3d
from ldcs_ros.plotting.style import (
    INK,
    LINE_COLOURS,
    LOAD_COLOUR,
    SCREEN,
    add_title,
    new_figure,
    style_axes,
)
from ldcs_ros.plotting.surface import add_displacement_key, common_frame, draw_surface
from ldcs_ros.reach.course import CommandCourse, Trajectory
from ldcs_ros.reach.workspace import Workspace

_VIEWS = ((0, 2), (1, 2), (0, 1))
_MOST_LINES = 2  # commands whose grid is drawn as lines


def workspace_figure(found: Workspace, flat: np.ndarray, title: str) -> Figure:
    """Draw the views from the side, from the front and from above.

    Lines have all commands but one fixed. Beyond two commands the rest positions are dots.

    Args:
        found: The workspace.
        flat: Place of the point on the flat sheet [m], shape (3,).
        title: Title of the scene.
    """
    count = len(found.variables)
    figure = new_figure(1.5 * SCREEN.width, 1.5 * SCREEN.row)
    panels = [figure.add_axes((0.07 + 0.32 * k, 0.2, 0.25, 0.62)) for k in range(len(_VIEWS))]
    for axes, (across, up) in zip(panels, _VIEWS, strict=True):
        place = MM * found.position[..., [across, up]]
        if count <= _MOST_LINES:
            _draw_lines(axes, place, found)
        else:
            dots = place.reshape(-1, 2)
            axes.plot(dots[:, 0], dots[:, 1], ".", color=LINE_COLOURS[0], markersize=3.0 * SCREEN.scale)
        axes.plot(*(MM * flat[[across, up]]), "+", color=LOAD_COLOUR, label="flat sheet")
        # The y range is often a hundredth of the others: only the view from the side has equal scales.
        if (across, up) == (0, 2):
            axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        names = "xyz"
        style_axes(axes, x_label=f"{names[across]} [mm]", y_label=f"{names[up]} [mm]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="lower center",
        ncols=len(labels),
        fontsize=SCREEN.label - 1.0,
        frameon=False,
        labelcolor=INK,
    )
    low, high = found.extent
    spans = ", ".join(
        f"{axis} {MM * a:.1f} to {MM * b:.1f} mm" for axis, a, b in zip("xyz", low, high, strict=True)
    )
    add_title(figure, f"{title}: where {found.place} rests", spans)
    return figure


def _draw_lines(axes: Axes, place: np.ndarray, found: Workspace) -> None:
    for k, variable in enumerate(found.variables):
        lines = np.moveaxis(place, k, 0).reshape(found.levels, -1, 2)
        label = f"{variable.name}: {command_in_words(variable.name, variable.low, variable.high)}"
        for number in range(lines.shape[1]):
            axes.plot(
                lines[:, number, 0],
                lines[:, number, 1],
                color=LINE_COLOURS[k],
                linewidth=0.9 * SCREEN.scale,
                label=label if number == 0 else None,
            )


def command_in_words(name: str, *values: float) -> str:
    """Return values of a command with their unit, `0 to 190 kPa`; pressures are gauge."""
    kind, last = name.partition(".")[0], name.split(".")[-2:-1]
    unit, factor = {"pressure": ("kPa", 1e-3), "torque": ("N m", 1.0)}.get(kind, ("N", 1.0))
    if last == ["torque"]:  # of a wrench
        unit = "N m"
    return f"{' to '.join(f'{factor * value:.4g}' for value in values)} {unit}"


def shape_error_figure(rest: np.ndarray, error: np.ndarray, annotations: Annotations, note: str) -> Figure:
    """Draw the sheet and its vertical distance to the shape.

    Args:
        rest: Node positions [m], shape (2, nx, ny, 3); NaN in holes.
        error: Height of each place above the shape [m], shape (nx, ny); NaN where none is asked.
        annotations: Rest shape, arms and loads of the scene.
        note: Text under the title.
    """
    width = 1.4 * SCREEN.width
    figure = new_figure(width, 0.5 * width)
    axes = new_axes_3d(figure, (0.02, 0.03, 0.45, 0.82))
    frame = common_frame([rest], annotations.rest)
    draw_surface(axes, rest, annotations, frame, large=True)
    key = figure.add_axes((0.49, 0.25, 0.012, 0.46))
    add_displacement_key(figure, key, frame)
    flat = MM * annotations.rest[0]
    largest = MM * float(np.nanmax(np.abs(error)))
    scale, colours = Normalize(-largest, largest), colormaps["RdBu_r"]
    plane = figure.add_axes((0.63, 0.17, 0.26, 0.62))
    plane.pcolormesh(
        flat[..., 0], flat[..., 1], MM * error, cmap=colours, norm=scale, shading="nearest", rasterized=True
    )
    plane.set_aspect("equal", adjustable="box")
    style_axes(plane, x_label="x on the flat sheet [mm]", y_label="y [mm]")
    key = figure.add_axes((0.905, 0.25, 0.014, 0.46))
    add_colour_bar(figure, key, ScalarMappable(scale, colours), "height above the shape [mm]")
    add_title(figure, annotations.title, note)
    return figure


def course_figure(found: CommandCourse, trajectory: Trajectory, title: str) -> Figure:
    """Draw the first two coordinates against each other, then the commands over time.

    Args:
        found: The course.
        trajectory: Its targets.
        title: Title of the scene.
    """
    figure = new_figure(1.5 * SCREEN.width, 1.5 * SCREEN.row)
    path, course = figure.add_axes((0.08, 0.2, 0.36, 0.62)), figure.add_axes((0.54, 0.2, 0.36, 0.62))
    names = [target.name for target in trajectory.coordinates]
    if len(names) > 1:
        labels = f"{names[0]} [mm]", f"{names[1]} [mm]"
        wanted, reached = (MM * trajectory.value[:, :2], MM * found.reached[:, :2])
        path.set_aspect("equal", adjustable="datalim")
    else:
        labels = "time [s]", f"{names[0]} [mm]"
        wanted, reached = (
            np.column_stack([trajectory.time, MM * value[:, 0]])
            for value in (trajectory.value, found.reached)
        )
    path.plot(*wanted.T, color=INK, linewidth=3.0, alpha=0.3, label="target")
    path.plot(*reached.T, color=LINE_COLOURS[0], label="reached")
    style_axes(path, x_label=labels[0], y_label=labels[1])
    for k, (name, values) in enumerate(found.commands.items()):
        largest = float(np.abs(values).max()) or 1.0
        colour = LINE_COLOURS[k % len(LINE_COLOURS)]
        course.plot(
            found.time,
            values / largest,
            color=colour,
            label=f"{name}, 1 is {command_in_words(name, largest)}",
        )
    style_axes(course, x_label="time [s]", y_label="command over its largest")
    path.legend(fontsize=7, frameon=False, loc="best")
    # Above the axes: lines may be anywhere inside.
    columns = 1 + (len(found.commands) - 1) // 4
    course.legend(fontsize=7, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)
    add_title(figure, f"{title}: RMS {MM * found.rms:.3g} mm")
    return figure

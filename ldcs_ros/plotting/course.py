"""A course of commands: what places do beside their targets, and the commands."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import INK, LINE_COLOURS, SCREEN, FigureStyle, add_title, new_figure, style_axes
from ldcs_ros.reach.course import CommandCourse, Trajectory

MM = 1e3


def course_figure(
    found: CommandCourse, trajectory: Trajectory, title: str, style: FigureStyle = SCREEN
) -> Figure:
    """Draw the first two coordinates against each other, then the commands over time.

    Args:
        found: The course.
        trajectory: Its targets.
        title: Title of the scene.
        style: Sizes.
    """
    figure = new_figure(style.width * (1.5 if style.headed else 1.0), style.row * 1.5)
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
    style_axes(path, x_label=labels[0], y_label=labels[1], style=style)
    for k, (name, values) in enumerate(found.commands.items()):
        largest = float(np.abs(values).max()) or 1.0
        colour = LINE_COLOURS[k % len(LINE_COLOURS)]
        course.plot(found.time, values / largest, color=colour, label=f"{name}, 1 is {largest:.4g}")
    style_axes(course, x_label="time [s]", y_label="command over its largest", style=style)
    for axes in (path, course):
        axes.legend(fontsize=7, frameon=False, loc="best")
    add_title(figure, f"{title}: RMS {MM * found.rms:.3g} mm", style=style)
    return figure

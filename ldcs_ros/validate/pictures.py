"""Pictures of the validation: the final shape in two views (Figure 5), P0 and P1 in time (Figure 8), a tornado plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.plotting.annotations import annotations_of_scene
from ldcs_ros.plotting.axes3d import new_axes_3d
from ldcs_ros.plotting.style import (
    AXIS_COLOURS,
    INK,
    LABEL_SIZE,
    LINE_COLOURS,
    SOFT_INK,
    add_title,
    label_line_ends,
    new_figure,
    save_figure,
    style_axes,
)
from ldcs_ros.plotting.surface import add_displacement_key, common_frame, draw_surface
from ldcs_ros.validate import paper
from ldcs_ros.validate.identifiability import Sensitivity
from ldcs_ros.validate.measure import Rest
from ldcs_ros.validate.tables import plausible_range, signed
from ldcs_ros.validate.transient import Damped, Transient

# A parameter whose effect the held radius cancels moves by rounding alone; the labels show 0.1 mm.
_VISIBLE = 1e-6  # mm
# (elevation, azimuth) [deg]: as in the paper's Figure 5 a, from the side of the clamp, and b, from the side edge.
VIEWS = (("a", 24.0, -125.0), ("b", 8.0, -72.0))


def shape_figure(rest: Rest, title: str) -> Figure:
    """Draw the final shape in two views."""
    scene = rest.simulation.scene
    annotations = annotations_of_scene(scene, title=title)
    position = rest.position.reshape(2, *scene.lattice.nodes, 3)
    frame = common_frame([position], annotations.rest)
    figure = new_figure(9.6, 4.0)
    for number, (letter, elevation, azimuth) in enumerate(VIEWS):
        axes = new_axes_3d(figure, (0.01 + 0.45 * number, -0.04, 0.46, 1.06))
        axes.patch.set_visible(False)
        draw_surface(axes, position, annotations, frame, large=False)
        axes.view_init(elev=elevation, azim=azimuth)
        axes.text2D(0.06, 0.8, letter, transform=axes.transAxes, color=INK, fontsize=LABEL_SIZE + 2)
    add_displacement_key(figure, figure.add_axes((0.93, 0.2, 0.012, 0.5)), frame)
    note = f"at rest; edges at r = {1e3 * rest.radius:.1f} mm (paper: 115 mm); compare the paper's Figure 5"
    add_title(figure, title, note)
    return figure


def transient_figure(transient: Transient, title: str) -> Figure:
    """Draw displacement against time of P0 and P1, with Table I's experiment as dashes."""
    height = 2.5 * len(paper.POINTS) + 0.8
    figure = new_figure(7.2, height)
    grid = figure.add_gridspec(
        len(paper.POINTS), 1, left=0.1, right=0.83, bottom=0.5 / height, top=1.0 - 0.75 / height, hspace=0.25
    )
    for number, name in enumerate(paper.POINTS):
        axes = figure.add_subplot(grid[number])
        labels = []
        for which, (axis, colour) in enumerate(AXIS_COLOURS.items()):
            track = transient.displacement[name][:, which]
            axes.plot(transient.time, track, color=colour, linewidth=1.7)
            axes.axhline(paper.EXPERIMENT[name][which], color=colour, linewidth=1.0, linestyle=(0, (5, 4)))
            labels.append((float(track[-1]), f"{axis}  {signed(track[-1], 1)} mm", colour))
        axes.margins(x=0.0, y=0.08)
        label_line_ends(axes, labels)
        last = number == len(paper.POINTS) - 1
        style_axes(axes, x_label="time [s]" if last else "", y_label="displacement [mm]", title=name)
    settled = f"within 0.1 mm of rest after {transient.settling:.2f} s"
    add_title(
        figure, title, f"lines: the twin   dashes: the experiment's steady values (Table I)   {settled}"
    )
    return figure


def damping_figure(runs: Sequence[Damped], title: str) -> Figure:
    """Draw the height of P1 against time for several dampings."""
    figure = new_figure(7.2, 3.6)
    axes = figure.add_axes((0.1, 0.14, 0.73, 0.66))
    labels = []
    for run, colour in zip(runs, LINE_COLOURS, strict=False):
        track = run.transient.displacement["P1"][:, 2]
        axes.plot(run.transient.time, track, color=colour, linewidth=1.5)
        labels.append((float(track[-1]), f"c = {run.damping:g} N s/m", colour))
    axes.axhline(paper.EXPERIMENT["P1"][2], color=SOFT_INK, linewidth=1.0, linestyle=(0, (5, 4)))
    axes.margins(x=0.0)
    label_line_ends(axes, labels)
    style_axes(axes, x_label="time [s]", y_label="uz of P1 [mm]")
    add_title(
        figure, title, "all dampers of sheet, joints and couplings scaled alike   dashes: the experiment"
    )
    return figure


def tornado_figure(found: Sequence[Sensitivity], title: str) -> Figure:
    """Draw the change of P0 and P1 when each parameter changes by its plausible range at a held radius."""
    shown = [item for item in found if np.abs(item.held[:4]).max() > _VISIBLE]
    figure = new_figure(9.6, 0.34 * len(shown) + 1.5)
    names = ("P0 x", "P0 z", "P1 x", "P1 z")
    bottom, top = 0.55 / figure.get_figheight(), 1.0 - 0.85 / figure.get_figheight()
    for number, name in enumerate(names):
        axes: Axes = figure.add_axes((0.245 + 0.187 * number, bottom, 0.172, top - bottom))
        change = np.array([item.held[number] for item in shown])[::-1]
        place = np.arange(len(shown))
        axes.barh(place, change, height=0.62, color=LINE_COLOURS[0])
        axes.barh(place, -change, height=0.62, color=LINE_COLOURS[1])
        reach = 1.6 * max(float(np.abs(change).max()), 0.5)
        axes.set_xlim(-reach, reach)
        for y, value in enumerate(change):
            side = -1.0 if value < 0.0 else 1.0
            axes.text(
                value + 0.03 * side * reach, y, signed(value, 1), fontsize=6.5, color=INK,
                va="center", ha="left" if side > 0 else "right",
            )  # fmt: skip
        words = [f"{item.parameter.short} ±{plausible_range(item.parameter)}" for item in shown][::-1]
        axes.set_yticks(place, words if number == 0 else [""] * len(shown))
        style_axes(axes, x_label="change [mm]", y_label="", title=name)
        axes.axvline(0.0, color=SOFT_INK, linewidth=0.6)
    note = (
        "blue: it grows by this range, orange: it shrinks (linearised); torque re-adjusted to the same radius"
    )
    add_title(figure, title, note)
    return figure


def write(figures: dict[str, Figure], folder: Path, kind: str = "png") -> list[Path]:
    """Write figures by name into a folder, made if needed, as 'png', 'pdf' or 'svg'; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [save_figure(figure, folder / f"{name}.{kind}") for name, figure in figures.items()]

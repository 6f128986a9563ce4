"""Draws the first picture of the README: the calibrated twin at rest, beside the numbers of the paper's Table I."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.plotting.annotations import annotations_of_scene
from ldcs_ros.plotting.style import (
    INK,
    LINE_COLOURS,
    SOFT_INK,
    add_title,
    new_figure,
    save_figure,
    style_axes,
)
from ldcs_ros.plotting.surface import MM, common_frame, draw_surface
from ldcs_ros.validate import paper

TARGET = Path(__file__).resolve().parents[1] / "docs/images/paper.png"
WIDTH, HEIGHT = 9.0, 3.6
ROWS = (("P1", 2), ("P1", 0), ("P0", 2), ("P0", 0))


def main() -> None:
    """Settle the scene, draw both halves and write the picture."""
    scene = load_scene("paper_calibrated")
    simulation = scene.build()
    simulation.settle()
    position, rest = simulation.state.position, scene.lattice.reference_position
    places = {name: scene.points[name].position(position) for name in paper.POINTS}
    moved = {name: MM * (places[name] - scene.points[name].position(rest)) for name in paper.POINTS}
    figure = new_figure(WIDTH, HEIGHT)
    axes: Any = figure.add_axes((0.0, 0.02, 0.46, 0.9), projection="3d", computed_zorder=False)
    sheet = position.reshape(2, *scene.lattice.nodes, 3)
    annotations = annotations_of_scene(scene, title=scene.title)
    draw_surface(axes, sheet, annotations, common_frame([sheet], annotations.rest), large=False)
    for name, place in places.items():
        axes.scatter(*(MM * place), s=22, color="white", edgecolors=INK, zorder=7, depthshade=False)
        axes.text(*(MM * place + [0.0, 0.0, -16.0]), name, color=INK, ha="center", zorder=8, fontsize=9.0)
    chart = figure.add_axes((0.56, 0.17, 0.42, 0.6))
    height = np.arange(len(ROWS), 0, -1)
    columns = (
        ("experiment", paper.EXPERIMENT, "s", INK),
        ("paper's model", paper.MODEL, "D", LINE_COLOURS[1]),
        ("this twin", moved, "o", LINE_COLOURS[0]),
    )
    for label, values, marker, colour in columns:
        error = [float(values[name][axis] - paper.EXPERIMENT[name][axis]) for name, axis in ROWS]
        chart.plot(error, height, marker, color=colour, label=label, markersize=7.0)
    for (name, axis), y in zip(ROWS, height, strict=True):
        chart.axhline(y, color=SOFT_INK, linewidth=0.4, zorder=0)
        chart.text(1.75, y + 0.14, f"{moved[name][axis]:.1f} mm", color=SOFT_INK, fontsize=8.0, ha="right")
    chart.set_yticks(height, [f"{name}  u{'xyz'[axis]}" for name, axis in ROWS])
    chart.set_xlim(-0.5, 1.8)
    chart.set_ylim(0.5, len(ROWS) + 0.6)
    style_axes(chart, x_label="steady displacement minus the experiment's [mm]", y_label="")
    chart.legend(loc="lower left", bbox_to_anchor=(-0.03, 1.0), ncol=3, frameon=False, fontsize=8.5)
    add_title(
        figure, "The paper's test: 40 g on the free edge, both arms actuated", "the calibrated twin at rest"
    )
    print(save_figure(figure, TARGET))


if __name__ == "__main__":
    main()

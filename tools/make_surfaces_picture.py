"""Draws scenes with other surfaces than the paper's at rest, for the README and the page on scenes."""

from __future__ import annotations

from pathlib import Path

from ldcs_ros import load_scene
from ldcs_ros.plotting.annotations import annotations_of_scene
from ldcs_ros.plotting.axes3d import new_axes_3d
from ldcs_ros.plotting.style import INK, new_figure, save_figure
from ldcs_ros.plotting.surface import common_frame, draw_surface

TARGET = Path(__file__).resolve().parents[1] / "docs/images/surfaces.png"
PANELS = (
    ("three_arms", "three_arms"),
    ("perforated", "perforated"),
    ("gripper_strip", "gripper_strip"),
    ("mould", "mould: saddle"),
    ("mould", "mould: bowl"),
    ("mould", "mould: dome"),
)
PRESSURES = {"mould: bowl": 60e3, "mould: dome": 0.0}
COLUMNS, WIDTH, HEIGHT = 3, 3.3, 2.5


def main() -> None:
    """Settle each scene, draw it into a panel and write the picture."""
    rows = len(PANELS) // COLUMNS
    figure = new_figure(COLUMNS * WIDTH, rows * HEIGHT, dpi=110)
    for number, (name, title) in enumerate(PANELS):
        scene = load_scene(name)
        simulation = scene.build()
        if title in PRESSURES:
            simulation.inputs.set_pressure(PRESSURES[title])
        simulation.settle()
        sheet = simulation.state.position.reshape(2, *scene.lattice.nodes, 3)
        annotations = annotations_of_scene(scene, title=title)
        row, column = divmod(number, COLUMNS)
        box = (column / COLUMNS, 1.0 - (row + 1) / rows, 1.0 / COLUMNS, 0.94 / rows)
        axes = new_axes_3d(figure, box)
        axes.patch.set_visible(False)
        draw_surface(axes, sheet, annotations, common_frame([sheet], annotations.rest), large=False)
        figure.text(box[0] + 0.5 * box[2], box[1] + 0.93 / rows, title, color=INK, ha="center", fontsize=11.0)
    save_figure(figure, TARGET)


if __name__ == "__main__":
    main()

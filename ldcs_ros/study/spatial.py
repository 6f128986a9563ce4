"""The error of the lattice itself: where P0 and P1 of a scene with a material stand, for finer and finer ones."""

from __future__ import annotations

import numpy as np

from ldcs_ros.study.problems import ERROR_TIMES, scene_of
from ldcs_ros.study.tasks import Row, Task
from ldcs_ros.study.timing import best_of

POINTS = ("P0", "P1")


def spatial_errors(task: Task) -> list[Row]:
    """Return one row with the points' positions at the comparison times [mm] in `extra`; `against_finest`
    compares."""
    scene = scene_of(task.scene, task.nodes, accuracy=task.value)
    course: list[float] = []

    def run() -> None:
        course.clear()
        simulation = scene.build()
        for time in ERROR_TIMES:
            simulation.advance_to(time)
            position = simulation.state.position
            course.extend(1e3 * x for name in POINTS for x in simulation.points[name].position(position))

    cpu, _ = best_of(1, run)
    return [
        Row(
            kind="spatial",
            scene=task.scene,
            nodes=task.nodes,
            method=task.method,
            setting=task.setting,
            value=task.value,
            cpu=cpu / ERROR_TIMES[-1],
            extra=" ".join(f"{x:.7f}" for x in course),
        )
    ]


def against_finest(rows: list[Row]) -> dict[int, float]:
    """Return the largest distance of P0 and P1 from those of the finest lattice [m], by nodes along a side."""
    placed = {
        row.nodes: np.array([float(x) for x in row.extra.split()])
        for row in rows
        if row.kind == "spatial" and not row.failure
    }
    if len(placed) < 2:
        return {}
    finest = max(placed)
    return {
        nodes: 1e-3 * float(np.linalg.norm((place - placed[finest]).reshape(-1, 3), axis=1).max())
        for nodes, place in sorted(placed.items())
        if nodes != finest
    }

"""Spatial convergence: P0 and P1 of a scene with a material, on finer and finer lattices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ldcs_ros.study.problems import ERROR_TIMES, positions, scene_of
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.timing import best_of

POINTS = ("P0", "P1")


def spatial_convergence(task: Task) -> list[Row]:
    """Return one row with the points' positions at the comparison times [mm] in `extra`."""
    scene = scene_of(task.scene, task.nodes, accuracy=task.value)
    cpu, motion = best_of(1, lambda: positions(scene.build(), ERROR_TIMES))
    points = [scene.build().points[name] for name in POINTS]
    places = [1e3 * x for position in motion for point in points for x in point.position(position)]
    extra = " ".join(f"{x:.7f}" for x in places)
    return [replace(task.row(), cpu=cpu / ERROR_TIMES[-1], extra=extra)]


def errors_against_finest(rows: Sequence[Row]) -> dict[int, float]:
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

"""What `accuracy` promises: the asked against the real error of the default method on every shipped scene."""

from __future__ import annotations

from functools import partial

import numpy as np

from ldcs_ros.study.problems import positions, scene_of
from ldcs_ros.study.tasks import REFERENCE_ACCURACY, Row, Task
from ldcs_ros.study.timing import best_of

ACCURACIES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
# Also between steps and during transients the error must hold: compared this often [s].
TIMES = tuple(round(0.02 * k, 2) for k in range(1, 101))


def promises(task: Task) -> list[Row]:
    """Return a row for each accuracy, with the reported error in `extra`; the task names the scene."""
    nodes = task.nodes or None
    reference = positions(scene_of(task.scene, nodes, accuracy=REFERENCE_ACCURACY).build(), TIMES)
    rows = []
    for accuracy in ACCURACIES:
        scene = scene_of(task.scene, nodes, accuracy=accuracy)
        simulation = scene.build()
        cpu, course = best_of(1, partial(positions, simulation, TIMES))
        counts = simulation.statistics
        rows.append(
            Row(
                kind="promise",
                scene=task.scene,
                nodes=scene.lattice.nodes[0],
                method=simulation.integrator.name,
                setting="accuracy",
                value=accuracy,
                error=float(np.abs(course - reference).max()),
                cpu=cpu / TIMES[-1],
                steps=counts.steps,
                rejected=counts.rejected_steps,
                evaluations=counts.evaluations,
                factorisations=counts.factorisations,
                extra=f"reported {counts.error_estimate:.3g}",
            )
        )
    return rows

"""Check of `accuracy`: the asked against the real error of the default method on every shipped scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import positions, scene_of
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.tasks import REFERENCE_ACCURACY
from ldcs_ros.study.timing import best_of

ACCURACIES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
TIMES = tuple(round(0.02 * k, 2) for k in range(1, 101))
MIN_FRACTION, MAX_FACTOR = 0.95, 3.0


def accuracy_check(task: Task) -> list[Row]:
    """Return a row for each accuracy, with the reported error in `extra`; the task names the scene."""
    nodes = task.nodes or None
    known = positions(scene_of(task.scene, nodes, accuracy=REFERENCE_ACCURACY).build(), TIMES)
    rows = []
    for accuracy in ACCURACIES:
        simulation = scene_of(task.scene, nodes, accuracy=accuracy).build()

        def run(simulation: Simulation = simulation) -> np.ndarray:
            return positions(simulation, TIMES)

        cpu, motion = best_of(1, run)
        spent = simulation.statistics
        row = replace(
            task.row(),
            nodes=simulation.lattice.nodes[0],
            method=simulation.integrator.name,
            value=accuracy,
            extra=f"reported {spent.error_estimate:.3g}",
        )
        rows.append(row.counted(spent).compared(motion, known, cpu, TIMES[-1]))
    return rows


@dataclass(frozen=True)
class AccuracySummary:
    """The accuracy check over all of its pairs of a scene and an accuracy.

    Attributes:
        pairs: Number of pairs.
        within: Fraction of pairs whose real error is at most the asked one.
        worst: Largest real over asked error; infinite for a pair without a result.
    """

    pairs: int
    within: float
    worst: float

    @property
    def met(self) -> bool:
        """Whether MIN_FRACTION of the pairs are within the asked error and none is above MAX_FACTOR times it."""
        return self.within >= MIN_FRACTION and self.worst <= MAX_FACTOR


def accuracy_summary(rows: Sequence[Row]) -> AccuracySummary:
    """Return the summary of the accuracy rows; without any, all of none are within."""
    factors = [math.inf if row.failure else row.error / row.value for row in rows if row.kind == "accuracy"]
    within = sum(factor <= 1.0 for factor in factors) / len(factors) if factors else 1.0
    return AccuracySummary(len(factors), within, max(factors, default=0.0))

"""A sweep from end to end: samples in chunks to worker processes, rows into a table as they come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ldcs_ros import __version__
from ldcs_ros.scene import Scene
from ldcs_ros.study.execute import workers
from ldcs_ros.sweep.design import Design, columns_of, neighbour_order
from ldcs_ros.sweep.evaluate import SampleResult, SampleTask, check_task, evaluate
from ldcs_ros.sweep.table import SweepTable

CHUNK = 16
"""Samples that follow each other in one process. The chunks are the same for any number of processes, and so are the
rest states that are followed: a scene with several of them gives the same table on every machine."""


@dataclass(frozen=True)
class Sweep:
    """A sweep.

    Attributes:
        scene: The scene.
        design: Samples of its factors.
        measures: `POINT.AXIS` in ldcs_base [m], or `radius` of the actuated edges [m].
        duration: Simulated time after which is measured [s]; None for the rest state.
    """

    scene: Scene
    design: Design
    measures: tuple[str, ...]
    duration: float | None = None

    @property
    def about(self) -> dict[str, object]:
        """The sweep as plain data; two tables of equal ones hold the same."""
        return {
            "version": __version__,
            "scene": self.scene.content,
            "design": asdict(self.design),
            "measures": list(self.measures),
            "duration": self.duration,
        }


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep.

    Attributes:
        samples: Values of the factors, shape (n, n_factors).
        measured: Values of the measures, shape (n, n_measures); NaN where a sample failed.
        rows: The rows in the order of the samples.
        continued: Rows that were in the table before.
    """

    samples: np.ndarray
    measured: np.ndarray
    rows: tuple[SampleResult, ...]
    continued: int

    @property
    def failures(self) -> list[SampleResult]:
        """The rows of samples that failed."""
        return [row for row in self.rows if row.failure]


def run_sweep(
    sweep: Sweep,
    path: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> SweepResult:
    """Run the samples that a table lacks, and return all.

    Args:
        sweep: The sweep.
        path: The table (CSV); continued if it is of the same sweep.
        jobs: Processes on this machine.
        scheduler: Address of a Dask scheduler, or 'local'; None for processes of this machine.
        progress: Called with the fraction that is done.

    Raises:
        SweepError: The sweep is not sound, or the table is of another one.
        MissingPackageError: A scheduler is named, and dask.distributed is not installed.
        StudyError: A worker process ended, or no scheduler answers.
    """
    samples = sweep.design.samples()
    factors = columns_of(sweep.design.factors)
    task = SampleTask(sweep.scene.content, sweep.scene.name, factors, sweep.measures, sweep.duration)
    check_task(task, samples[0])
    table = SweepTable(path, sweep.about, factors, sweep.measures)
    continued = len(table.rows)
    order = neighbour_order(samples)
    chunks = [order[k : k + CHUNK] for k in range(0, len(order), CHUNK)]
    chunks = [chunk for chunk in chunks if any(int(index) not in table.rows for index in chunk)]
    calls = [
        partial(evaluate, task, tuple(int(index) for index in chunk), samples[chunk]) for chunk in chunks
    ]
    progress(continued / len(samples))
    if calls:
        with workers(min(jobs, len(calls)), scheduler) as submit:
            for _, rows in submit(calls):
                table.add(rows)
                progress(len(table.rows) / len(samples))
    ordered = tuple(table.rows[index] for index in range(len(samples)))
    return SweepResult(samples, table.measured(len(samples)), ordered, continued)

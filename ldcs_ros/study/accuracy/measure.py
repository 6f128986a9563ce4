"""Real against asked and estimated errors of the product, for cases with an independent reference."""

from __future__ import annotations

import time as wall_clock
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.scene.load import load_scene
from ldcs_ros.study.accuracy.random_scenes import Case
from ldcs_ros.study.accuracy.reference import CACHE, TooSlow, looks_of, reference, start_velocity


@dataclass(frozen=True)
class Pair:
    """A case and an asked accuracy.

    Attributes:
        case: Name of the case.
        asked: Asked accuracy [m].
        real: Largest Euclidean distance of a node from the reference [m].
        estimate: Error that the product estimates [m].
        steps: Its steps, rejected ones included.
        cpu: Its processor time [s].
        failure: Reason of a run that ended early; empty otherwise.
    """

    case: str
    asked: float
    real: float
    estimate: float
    steps: int
    cpu: float
    failure: str = ""


def pairs(
    cases: Iterable[Case],
    accuracies: tuple[float, ...],
    *,
    cache: Path = CACHE,
    seconds: float = 60.0,
) -> Iterator[Pair]:
    """Yield the pairs of cases and accuracies, without cases that a scene or the reference's time refuses."""
    for case in cases:
        try:
            load_scene(case.content).build()
            truth = reference(case, cache=cache, seconds=seconds)
        except (SceneError, TooSlow):
            continue
        for accuracy in accuracies:
            yield measure(case, accuracy, truth)


def measure(case: Case, accuracy: float, truth: np.ndarray) -> Pair:
    """Return the errors of one run of a case against its reference, shape (looks, n_nodes, 3) [m]."""
    simulation = load_scene(case.content).with_accuracy(accuracy).build()
    velocity = start_velocity(case, simulation.state.position)
    started = wall_clock.process_time()
    real, failure = 0.0, ""
    try:
        if velocity is not None:
            simulation.start_from(simulation.state.position, velocity)
        for time, position in zip(looks_of(case), truth, strict=True):
            simulation.advance_to(time)
            gap = np.linalg.norm(simulation.state.position - position, axis=1)
            real = max(real, float(gap.max()))
    except DivergenceError as error:
        failure = str(error)
    statistics = simulation.statistics
    return Pair(
        case.name,
        accuracy,
        real,
        statistics.error_estimate,
        statistics.steps + statistics.rejected_steps,
        wall_clock.process_time() - started,
        failure,
    )

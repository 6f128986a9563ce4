"""Real against asked and estimated errors of the product, for cases with an independent reference."""

from __future__ import annotations

import math
import time as wall_clock
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.scene.load import load_scene
from ldcs_ros.study.accuracy.random_scenes import Case
from ldcs_ros.study.accuracy.reference import CACHE, TooSlow, looks_of, reference_motion, start_velocity

if TYPE_CHECKING:
    from ldcs_ros.simulation.simulation import Simulation

# Accuracy of the run that takes the place of a reference that takes too long, beside the finest one that is asked.
FINER = 0.01


@dataclass(frozen=True)
class Pair:
    """A case and an asked accuracy; promises are 0 where a scene has nothing of the kind.

    Attributes:
        case: Name of the case.
        asked: Asked accuracy [m].
        real: Largest Euclidean distance of a node from the reference [m].
        estimate: Error that the product estimates [m].
        steps: Its steps, rejected ones included.
        cpu: Its processor time [s].
        failure: Reason of a run that ended early; empty otherwise.
        reference: 'SciPy', or 'finer run' where that takes too long.
        velocity: Largest error of a node velocity [m/s].
        velocity_estimate: The one that the product estimates [m/s].
        velocity_promise: Asked accuracy times the fastest undamped frequency of the scene at rest [m/s].
        turn: Largest error of a point's orientation [rad].
        turn_promise: Three asked accuracies over the shortest distance that an orientation is taken from [rad].
        joint: Largest error of a joint angle [rad].
        joint_promise: Three asked accuracies over the shortest link [rad].
        joint_rate: Largest error of a joint's rate [rad/s].
    """

    case: str
    asked: float
    real: float
    estimate: float
    steps: int
    cpu: float
    failure: str = ""
    reference: str = "SciPy"
    velocity: float = 0.0
    velocity_estimate: float = 0.0
    velocity_promise: float = 0.0
    turn: float = 0.0
    turn_promise: float = 0.0
    joint: float = 0.0
    joint_promise: float = 0.0
    joint_rate: float = 0.0


@dataclass(frozen=True)
class Truth:
    """A reference: coordinates and rates at the looks of a case, shape (looks, n_coordinates), and its source."""

    q: np.ndarray
    u: np.ndarray
    source: str


def pairs(
    case: Case, accuracies: tuple[float, ...], *, cache: Path = CACHE, seconds: float = 60.0
) -> Iterator[Pair]:
    """Yield the pairs of a case and accuracies; none if it is no scene.

    Args:
        case: The case.
        accuracies: Asked accuracies [m].
        cache: Folder of references.
        seconds: Processor time that an independent reference may take; above it a finer run takes its place.
    """
    try:
        load_scene(case.content).build()
    except SceneError:
        return
    try:
        truth = Truth(*reference_motion(case, cache=cache, seconds=seconds), "SciPy")
    except (TooSlow, ArithmeticError):
        simulation = _started(case, FINER * min(accuracies))
        motions = []
        for time in looks_of(case):
            simulation.advance_to(time)
            motions.append(simulation.motion())
        truth = Truth(np.array([m.q for m in motions]), np.array([m.u for m in motions]), "finer run")
    for accuracy in accuracies:
        yield measure(case, accuracy, truth)


def measure(case: Case, accuracy: float, truth: Truth) -> Pair:
    """Return the errors of one run of a case against its reference."""
    simulation = _started(case, accuracy)
    spans = _spans(simulation)
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    frequency = math.sqrt(max(mode.stiffness, 0.0))
    started = wall_clock.process_time()
    worst, failure = np.zeros(5), ""
    try:
        for time, q, u in zip(looks_of(case), truth.q, truth.u, strict=True):
            simulation.advance_to(time)
            worst = np.maximum(worst, _errors(simulation, q, u))
    except DivergenceError as error:
        failure = str(error)
    cpu, spent = wall_clock.process_time() - started, simulation.statistics
    return Pair(
        case.name,
        accuracy,
        float(worst[0]),
        spent.error_estimate,
        spent.steps + spent.rejected_steps,
        cpu,
        failure,
        truth.source,
        float(worst[1]),
        spent.velocity_estimate,
        accuracy * frequency,
        float(worst[2]),
        3.0 * accuracy / spans[0],
        float(worst[3]),
        3.0 * accuracy / spans[1],
        float(worst[4]),
    )


def _started(case: Case, accuracy: float) -> Simulation:
    simulation = load_scene(case.content).with_accuracy(accuracy).build()
    place = np.array(case.start) if case.start else simulation.state.position
    velocity = start_velocity(case, place)
    if case.start or velocity is not None:
        simulation.start_from(place, velocity)
    return simulation


def _spans(simulation: Simulation) -> tuple[float, float]:
    """Return the shortest distances [m] that orientations of points and angles of joints are taken over."""
    rest = simulation.lattice.reference_position
    turns = [
        float(np.linalg.norm(one.minus(other, rest)))
        for point in simulation.points.values()
        for one, other in ((point.ahead, point.behind), (point.left, point.right))
    ]
    arms = simulation.model.arms
    return min(turns, default=math.inf), math.inf if arms is None else float(
        arms.link_length[arms.used].min()
    )


def _errors(simulation: Simulation, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the largest errors of node positions and velocities, orientations, joint angles and rates, shape (5,)."""
    motion, n = simulation.motion(), 3 * simulation.lattice.n_nodes
    own, true = motion.q[:n].reshape(-1, 3), q[:n].reshape(-1, 3)
    position = np.linalg.norm(own - true, axis=1)
    velocity = np.linalg.norm((motion.u - u)[:n].reshape(-1, 3), axis=1)
    # |sin| of half the angle between two frames is the Frobenius distance over sqrt(8).
    gaps = [np.linalg.norm(point.frame(own) - point.frame(true)) for point in simulation.points.values()]
    turn = 2.0 * math.asin(min(max(gaps, default=0.0) / math.sqrt(8.0), 1.0))
    arms = (len(simulation.arm_names), -1) if simulation.model.n_angles else (0, 0)
    joint, rate = (
        np.diff(part[n:].reshape(arms), axis=1, prepend=0.0).ravel()[simulation.joint_index]
        for part in (motion.q - q, motion.u - u)
    )
    largest = [float(np.max(np.abs(values), initial=0.0)) for values in (joint, rate)]
    return np.array([np.nanmax(position), np.nanmax(velocity), turn, *largest])

"""The motion in time (the paper's Figure 8): its settling, and the effect of the damping c on accuracy and cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.schema.paths import get_number, with_values
from ldcs_ros.validate.measure import MM, at_rest, displacement

DURATION, RATE = 3.0, 200  # s, samples per second
TIGHT = 0.01  # fraction of the accuracy at which the reference run of an error is made
SETTLED = 0.1  # mm: the tracker's accuracy
DAMPINGS = (0.05, 0.5, 1.6, 5.0, 16.0)  # N s/m
DAMPERS = ("effects.springs.damping", "effects.arms.joint_damping", "effects.arms.coupling_damping")


@dataclass(frozen=True)
class Transient:
    """A run from the flat sheet at rest, with gravity and actuation at t = 0.

    Attributes:
        time: Sample times [s], shape (n,).
        displacement: Displacement of each point [mm], shape (n, 3), by name.
        settling: Time after which every point stays within `SETTLED` of its rest place [s]; infinite if never.
        overshoot: Largest distance beyond the rest place along z of any point [mm].
        steps: Steps taken, rejected ones included.
        wall_time: Time spent integrating [s].
    """

    time: np.ndarray
    displacement: dict[str, np.ndarray]
    settling: float
    overshoot: float
    steps: int
    wall_time: float


def simulate(scene: Scene) -> Transient:
    """Return the motion of P0, P1, ... of a scene."""
    rest = at_rest(scene).displacement
    simulation = scene.build()
    time = np.arange(round(DURATION * RATE) + 1) / RATE
    moves: dict[str, list[np.ndarray]] = {name: [] for name in simulation.points}
    for instant in time:
        simulation.advance_to(float(instant))
        for name, shift in displacement(simulation).items():
            moves[name].append(shift)
    tracks = {name: np.array(shifts) for name, shifts in moves.items()}
    away = np.max([np.linalg.norm(track - rest[name], axis=1) for name, track in tracks.items()], axis=0)
    beyond = max(
        float(np.max(np.sign(rest[name][2]) * (track[:, 2] - rest[name][2])))
        for name, track in tracks.items()
    )
    late = np.flatnonzero(away > SETTLED)
    settling = (
        0.0 if not late.size else float("inf") if late[-1] == len(time) - 1 else float(time[late[-1] + 1])
    )
    statistics = simulation.statistics
    steps = statistics.steps + statistics.rejected_steps
    return Transient(time, tracks, settling, max(beyond, 0.0), steps, statistics.wall_time)


@dataclass(frozen=True)
class Damped:
    """The calibrated test with other damping.

    Attributes:
        damping: Coefficient c of the sheet's dampers [N s/m]; all other dampers are scaled alike.
        transient: The motion at the scene's accuracy.
        error: Largest distance of P0 and P1 from a run a hundred times as accurate [m].
    """

    damping: float
    transient: Transient
    error: float


def with_damping(content: dict[str, Any], damping: float) -> dict[str, Any]:
    """Return a scene with coefficient c [N s/m] in the sheet, and the arms' dampers scaled by the same factor."""
    factor = damping / get_number(content, DAMPERS[0])
    return with_values(content, {path: factor * get_number(content, path) for path in DAMPERS})


def sweep(content: dict[str, Any], dampings: Sequence[float] = DAMPINGS) -> Iterator[Damped]:
    """Yield the motion for each damping, with its error against a run a hundred times as accurate."""
    for damping in dampings:
        scene = load_scene(with_damping(content, damping))
        transient = simulate(scene)
        exact = simulate(scene.with_accuracy(TIGHT * float(scene.solver.accuracy or 1e-5)))
        gap = max(
            float(np.linalg.norm(transient.displacement[name] - exact.displacement[name], axis=1).max())
            for name in transient.displacement
        )
        yield Damped(damping, transient, gap / MM)


def time_constant(content: dict[str, Any]) -> float:
    """Return c / k of the sheet's springs [s], in which a stretched spring creeps back against its own damper."""
    return get_number(content, DAMPERS[0]) / get_number(content, "effects.springs.stiffness")

"""What a fourth-order stabilised explicit method (ROCK4) would cost at best: its stages for our own method's steps.

Such a method needs s stages for a step h with 0.353 s^2 >= h rho, rho the spectral radius, and has 152 at most
(Abdulle, Fourth order Chebyshev methods with recurrence relation, SIAM J. Sci. Comput. 23, 2002). Steps are granted
to it as long as those of the implicit method of the same order, none rejected, and nothing counts but force
evaluations, in a compiled loop.
"""

from __future__ import annotations

import math
import time

from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread
from ldcs_ros.study.problems import ERROR_TIMES, scene_of
from ldcs_ros.study.tasks import Row, Task
from ldcs_ros.study.timing import best_of

INTERVAL, LEAST_STAGES, MOST_STAGES = 0.353, 5, 152
METHOD = "rock4_bound"
CALLS = 200


def evaluations(steps: list[float], radius: float) -> int:
    """Return how many force evaluations steps [s] take at a spectral radius [1/s]; too long ones are divided."""
    total = 0
    for h in steps:
        parts = max(1, math.ceil(h * radius / (INTERVAL * MOST_STAGES**2)))
        total += parts * max(LEAST_STAGES, math.ceil(math.sqrt(h / parts * radius / INTERVAL)))
    return total


def bound(task: Task) -> list[Row]:
    """Return one row: the CPU time that the stages alone would take; `extra` has ours in the same process."""
    scene = scene_of(task.scene, task.nodes, accuracy=task.value)
    scene.build().advance_to(0.01)  # loads and compiles
    own, _ = best_of(task.runs, lambda: scene.build().advance_to(ERROR_TIMES[-1]))
    simulation = scene.build()
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    steps: list[float] = []
    while simulation.time < ERROR_TIMES[-1]:
        # Just past the end of the last step: the next one is made, as long as it likes.
        simulation.advance_to(min(simulation.last_step.right.time + 1e-7, ERROR_TIMES[-1]))
        step = simulation.last_step
        steps.append(step.right.time - step.left.time)
    count = evaluations(steps, mode.spectral_radius)
    one = _one_evaluation(task, simulation, mode.spectral_radius)
    return [
        Row(
            kind="bound",
            scene=task.scene,
            nodes=task.nodes,
            method=METHOD,
            setting=task.setting,
            value=task.value,
            cpu=count * one / ERROR_TIMES[-1],
            steps=len(steps),
            evaluations=count,
            extra=f"own {own / ERROR_TIMES[-1]:.6g} evaluation {1e6 * one:.4g}",
        )
    ]


def _one_evaluation(task: Task, simulation: Simulation, radius: float) -> float:
    """Return the CPU time of a stage [s]: the compiled baseline's where springs do all the work, else the force's."""
    from ldcs_ros.study.baseline import ArcBaseline

    if task.scene in ("arc", "hanging_sheet") and HAVE_NUMBA:
        solver = ArcBaseline(task.nodes, 0.05, radius)
        solver.run(ERROR_TIMES[:1])
        taken, _ = best_of(3, lambda: solver.run(ERROR_TIMES[:1]))
        return taken / (round(ERROR_TIMES[0] / solver.h) * solver.stages)
    model, motion, held = simulation.model, simulation.motion(), simulation.inputs.held()
    best = math.inf
    with one_thread():
        for _ in range(5):
            began = time.thread_time()
            for _ in range(CALLS):
                model.force(motion.time, motion.q, motion.u, held)
            best = min(best, (time.thread_time() - began) / CALLS)
    return best


def figures(row: Row) -> tuple[float, float]:
    """Return our CPU seconds per simulated second beside the bound's, and the time of an evaluation [us]."""
    words = row.extra.split()
    return float(words[1]), float(words[3])

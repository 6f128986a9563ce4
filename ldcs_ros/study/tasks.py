"""Performs the tasks of a study: each gives rows, in any process; a failure becomes a row with its reason."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import ERROR_TIMES, positions, scene_of, spectral_radius
from ldcs_ros.study.rows import BASELINE, SCIPY, Row, Task
from ldcs_ros.study.timing import best_of

REFERENCE_ACCURACY = 1e-9  # m
COARSER_REFERENCES = {65: 1e-8, 129: 1e-7}
PROBE, LONG_PROBE = 0.005, 0.05  # s of simulation time
INTERVAL = 0.02  # s of simulation time between two looks at the CPU time spent
WATCHED_FRACTION = 0.2
LIMITED = ("rk4", "semi_implicit_euler")
# Modules of the other kinds; each has a function of the module's name.
MODULES = {
    "accuracy": "accuracy_check",
    "effect": "effect_costs",
    "spatial": "spatial_convergence",
    "scaling": "scaling",
    "rate": "command_rates",
    "verified": "verified_runs",
    "paired": "paired_runs",
    "learning": "environment_steps",
}


def reference(scene: str, nodes: int) -> np.ndarray:
    """Return the reference positions of a problem at ERROR_TIMES [m], shape (n_times, n_nodes, 3)."""
    accuracy = COARSER_REFERENCES.get(nodes, REFERENCE_ACCURACY)
    return positions(scene_of(scene, nodes, integrator="esdirk43", accuracy=accuracy).build(), ERROR_TIMES)


def perform(task: Task, known: np.ndarray | None = None) -> list[Row]:
    """Perform a task and return its rows; a failure becomes a row with its reason.

    Args:
        task: The measurement.
        known: Reference positions for a task with a problem [m], shape (n_times, n_nodes, 3).
    """
    try:
        if task.kind in MODULES:
            name = MODULES[task.kind]
            measure: Callable[[Task], list[Row]] = getattr(import_module(f"ldcs_ros.study.{name}"), name)
            return measure(task)
        if known is None:
            raise RuntimeError(f"no reference of {task.scene}, {task.nodes} x {task.nodes}")
        measure_curve = _baseline if task.method == BASELINE else _scipy if task.method in SCIPY else _own
        row = measure_curve(task, known)
        # A motion that left the sheet's size is a failure, too.
        if not (row.failure or row.error < 1.0):
            raise RuntimeError(f"the motion left the sheet: error {row.error:.3g} m")
        return [row]
    except (LdcsError, RuntimeError, MemoryError) as error:
        return [replace(task.row(), failure=" ".join(str(error).split()) or type(error).__name__)]


def _own(task: Task, known: np.ndarray) -> Row:
    scene = scene_of(task.scene, task.nodes, integrator=task.method, **{task.setting: task.value})
    limited = task.setting == "dt" or task.method in LIMITED
    pace = _pace(scene, PROBE if limited else LONG_PROBE)
    # A stability limit keeps the pace of the first steps; the pace of other methods may change.
    if limited and pace * ERROR_TIMES[-1] > task.budget:
        return _too_slow(task, pace)
    watched = pace * ERROR_TIMES[-1] > WATCHED_FRACTION * task.budget

    def run() -> tuple[np.ndarray, Simulation]:
        simulation = scene.build()
        return positions(simulation, ERROR_TIMES, _Budget(task.budget) if watched else None), simulation

    cpu, (motion, simulation) = best_of(task.runs, run)
    return task.row().counted(simulation.statistics).compared(motion, known, cpu, ERROR_TIMES[-1])


def _scipy(task: Task, known: np.ndarray) -> Row:
    from ldcs_ros.study.scipy_solvers import solve

    kind = task.method.removeprefix("scipy_")
    scene = scene_of(task.scene, task.nodes)
    scene.build().advance_to(1e-4)  # loads and compiles
    cpu, (motion, spent) = best_of(
        task.runs, lambda: solve(scene.build(), kind, task.value, ERROR_TIMES, budget=task.budget)
    )
    return task.row().counted(spent).compared(motion, known, cpu, ERROR_TIMES[-1])


def _baseline(task: Task, known: np.ndarray) -> Row:
    from ldcs_ros.study.baseline import ArcBaseline

    if not HAVE_NUMBA:
        raise RuntimeError("the compiled baseline needs numba")
    ArcBaseline(5, 0.1, 1e3).run(ERROR_TIMES[:1])  # compiles
    solver = ArcBaseline(task.nodes, task.value, spectral_radius("arc", task.nodes))
    pace = best_of(1, solver.step)[0] / solver.h
    if pace * ERROR_TIMES[-1] > task.budget:
        return _too_slow(task, pace)
    cpu, motion = best_of(task.runs, lambda: solver.run(ERROR_TIMES))
    return solver.counted(task.row(), ERROR_TIMES[-1]).compared(motion, known, cpu, ERROR_TIMES[-1])


def _too_slow(task: Task, pace: float) -> Row:
    failure = f"too slow: {pace:.2g} CPU s per simulated second by its first steps"
    return replace(task.row(), cpu=pace, failure=failure)


def _pace(scene: Scene, probe: float) -> float:
    """Return the CPU seconds per simulated second of the first `probe` seconds."""
    simulation = scene.build()
    simulation.advance_to(1e-4)  # loads and compiles
    cpu, _ = best_of(1, lambda: simulation.advance_to(probe))
    return cpu / (probe - 1e-4)


class _Budget:
    # Checks the CPU time of a run [s] every INTERVAL of simulation time.
    def __init__(self, budget: float) -> None:
        self.budget, self.began = budget, time.thread_time()

    def __call__(self, simulation: Simulation, end: float) -> None:
        while simulation.time < end:
            simulation.advance_to(min(end, simulation.time + INTERVAL))
            spent = time.thread_time() - self.began
            if spent > self.budget:
                raise RuntimeError(f"too slow: {spent / simulation.time:.2g} CPU s per simulated second")

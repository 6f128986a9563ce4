"""One measurement: what it is asked, and the rows of the table that it gives; runs in any process."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from typing import Any

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import ERROR_TIMES, positions, scene_of
from ldcs_ros.study.timing import best_of

REFERENCE_ACCURACY = 1e-9  # m
# Of larger lattices: still a hundredth of what is asked of them [nodes along a side -> m].
COARSER_REFERENCES = {65: 1e-8, 129: 1e-7}
# A run whose first PROBE seconds foretell more than the budget is not made.
PROBE = 0.005  # s of simulation time
# Methods that choose their steps by accuracy are judged by more, and stopped if the budget is spent before the end.
LONG_PROBE, LOOK, WATCHED_SHARE = 0.05, 0.02, 0.2
LIMITED = ("rk4", "semi_implicit_euler")
BASELINE, SCIPY = "compiled_rkc2", ("scipy_BDF", "scipy_Radau")
METHODS_APART = (BASELINE, *SCIPY)


@dataclass(frozen=True)
class Row:
    """One line of the CSV.

    Attributes:
        kind: 'curve' (a point of a work-precision diagram), 'promise' (asked against real accuracy), 'effect' (cost of
            an effect), 'spatial' (error of the lattice itself), 'growth' (cost and memory by lattice size), 'rate'
            (commands at a rate), 'bound' (a method that is not there, at best), 'check' (the reference against another
            solver).
        scene: Problem by name.
        nodes: Nodes along a side.
        method: Integrator, or a solver that is not ours.
        setting: 'accuracy', 'dt' or 'rate'; for an effect, which one was left out.
        value: The setting's value [m, s or Hz].
        error: Largest node position error at the comparison times [m].
        cpu: CPU seconds per simulated second, one thread.
        steps: Accepted steps.
        rejected: Rejected steps.
        evaluations: Force evaluations.
        factorisations: Matrices factored.
        extra: What a kind has beside these, as text.
        failure: Why there is no error, '' if there is one.
    """

    kind: str
    scene: str
    nodes: int
    method: str
    setting: str
    value: float
    error: float = float("nan")
    cpu: float = float("nan")
    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorisations: int = 0
    extra: str = ""
    failure: str = ""


COLUMNS = tuple(field.name for field in fields(Row))


@dataclass(frozen=True)
class Task:
    """What to measure; see Row for the names.

    Attributes:
        runs: How often to run at most; the best CPU time counts.
        budget: CPU seconds that one run may take by its first steps' pace [s].
        weight: About how many seconds it takes; for the progress bar only.
    """

    kind: str
    scene: str
    nodes: int
    method: str
    setting: str
    value: float
    runs: int = 3
    budget: float = 30.0
    weight: float = 1.0

    @property
    def key(self) -> tuple[str, str, int, str, str, str]:
        """What makes it the same measurement as another."""
        return self.kind, self.scene, self.nodes, self.method, self.setting, f"{self.value:.6g}"

    @property
    def problem(self) -> tuple[str, int] | None:
        """Which reference solution it needs, if any."""
        return (self.scene, self.nodes) if self.kind in ("curve", "check") else None


def key_of(row: Row) -> tuple[str, str, int, str, str, str]:
    """Return the key of the task that a row came from."""
    return row.kind, row.scene, row.nodes, row.method, row.setting, f"{row.value:.6g}"


def reference(scene: str, nodes: int) -> np.ndarray:
    """Return the reference positions of a problem at ERROR_TIMES [m]."""
    accuracy = COARSER_REFERENCES.get(nodes, REFERENCE_ACCURACY)
    return positions(scene_of(scene, nodes, integrator="esdirk43", accuracy=accuracy).build(), ERROR_TIMES)


def perform(task: Task, known: np.ndarray | None = None) -> list[Row]:
    """Carry a task out and return its rows; a failure becomes a row that says why.

    Args:
        task: What to measure.
        known: Reference positions for a task with a problem [m], shape (n_times, n_nodes, 3).
    """
    try:
        if task.kind in ("curve", "check"):
            return [_curve(task, known)]
        return _special(task.kind)(task)
    except (LdcsError, RuntimeError, MemoryError) as error:
        return [_row(task, failure=" ".join(str(error).split()) or type(error).__name__)]


def _special(kind: str) -> Callable[[Task], list[Row]]:
    """Return what makes the rows of a kind; each lives in a module of its own."""
    module, name = {
        "promise": ("promise", "promises"),
        "effect": ("effect_costs", "effect_costs"),
        "spatial": ("spatial", "spatial_errors"),
        "growth": ("growth", "growth"),
        "rate": ("command_rates", "command_rates"),
        "bound": ("stabilised", "bound"),
    }[kind]
    made: Callable[[Task], list[Row]] = getattr(import_module(f"ldcs_ros.study.{module}"), name)
    return made


def _row(task: Task, **values: Any) -> Row:
    named = {name: value for name, value in asdict(task).items() if name in COLUMNS}
    return Row(**{**named, **values})


def _curve(task: Task, known: np.ndarray | None) -> Row:
    if task.method == BASELINE:
        return _baseline(task, known)
    if task.method in SCIPY:
        return _scipy(task, known)
    scene = scene_of(task.scene, task.nodes, integrator=task.method, **{task.setting: task.value})
    limited = task.setting == "dt" or task.method in LIMITED
    pace = _pace(scene, PROBE if limited else LONG_PROBE)
    # Steps that stability limits keep their pace; others may only be watched.
    if limited and pace * ERROR_TIMES[-1] > task.budget:
        return _row(
            task, cpu=pace, failure=f"too slow: {pace:.2g} CPU s per simulated second by its first steps"
        )
    watched = pace * ERROR_TIMES[-1] > WATCHED_SHARE * task.budget

    def run() -> tuple[np.ndarray, Any]:
        simulation = scene.build()
        if watched:
            return np.array(_watch(simulation, task.budget)), simulation.statistics
        return positions(simulation, ERROR_TIMES), simulation.statistics

    cpu, (course, counts) = best_of(task.runs, run)
    return _row(
        task,
        error=_error(course, known),
        cpu=cpu / ERROR_TIMES[-1],
        steps=counts.steps,
        rejected=counts.rejected_steps,
        evaluations=counts.evaluations,
        factorisations=counts.factorisations,
    )


def _scipy(task: Task, known: np.ndarray | None) -> Row:
    from ldcs_ros.study.scipy_solvers import solve

    kind = task.method.removeprefix("scipy_")
    scene = scene_of(task.scene, task.nodes)
    scene.build().advance_to(1e-4)  # loads and compiles
    cpu, (course, counts) = best_of(
        task.runs, lambda: solve(scene.build(), kind, task.value, ERROR_TIMES, budget=task.budget)
    )
    return _row(task, error=_error(course, known), cpu=cpu / ERROR_TIMES[-1], **counts)


def _baseline(task: Task, known: np.ndarray | None) -> Row:
    from ldcs_ros.integrators.spectrum import fastest_mode
    from ldcs_ros.study.baseline import ArcBaseline

    if not HAVE_NUMBA:
        raise RuntimeError("the compiled baseline needs numba")
    simulation = scene_of("arc", task.nodes).build()
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    ArcBaseline(5, 0.1, 1e3).run(ERROR_TIMES[:1])  # compiles
    solver = ArcBaseline(task.nodes, task.value, mode.spectral_radius)
    pace = best_of(1, solver.step)[0] / solver.h
    if pace * ERROR_TIMES[-1] > task.budget:
        return _row(
            task, cpu=pace, failure=f"too slow: {pace:.2g} CPU s per simulated second by its first step"
        )
    cpu, course = best_of(task.runs, lambda: solver.run(ERROR_TIMES))
    steps = round(ERROR_TIMES[-1] / solver.h)
    return _row(
        task,
        error=_error(course, known),
        cpu=cpu / ERROR_TIMES[-1],
        steps=steps,
        evaluations=steps * solver.stages,
    )


def _pace(scene: Scene, probe: float) -> float:
    """Return the CPU seconds per simulated second of the first `probe` seconds."""
    simulation = scene.build()
    simulation.advance_to(1e-4)  # loads and compiles
    cpu, _ = best_of(1, lambda: simulation.advance_to(probe))
    return cpu / (probe - 1e-4)


def _watch(simulation: Simulation, budget: float) -> list[np.ndarray]:
    """Return the positions at the comparison times of a long run, looked at now and then.

    Raises:
        RuntimeError: It has taken more CPU time than the budget [s].
    """
    began, course = time.thread_time(), []
    for asked in ERROR_TIMES:
        while simulation.time < asked:
            simulation.advance_to(min(asked, simulation.time + LOOK))
            spent = time.thread_time() - began
            if spent > budget:
                raise RuntimeError(f"too slow: {spent / simulation.time:.2g} CPU s per simulated second")
        course.append(simulation.state.position)
    return course


def _error(course: np.ndarray, known: np.ndarray | None) -> float:
    error = float("nan") if known is None else float(np.abs(course - known).max())
    # Also a course that left the sheet's size is a failure, told as one.
    if not error < 1.0:
        raise RuntimeError(f"the motion left the sheet: error {error:.3g} m")
    return error

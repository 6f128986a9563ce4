"""What command rates cost: a course followed smoothly and sent as steps at a rate, by us, a compiled loop and SciPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.drive_profiles import PERIOD, DriveProfile, follow, problem, sampled
from ldcs_ros.study.problems import positions
from ldcs_ros.study.scipy_solvers import solve
from ldcs_ros.study.tasks import BASELINE, Row, Task
from ldcs_ros.study.timing import best_of

ACCURACY, REFERENCE = 1e-5, 1e-7  # m
# The error is the largest at these times: between commands too, and one whole period of the course [s].
TIMES = tuple(round(0.02 * k, 2) for k in range(1, round(PERIOD / 0.02) + 1))
BASELINE_STEPS = (0.02, 0.01, 0.005, 0.002, 0.001)
BDF_ACCURACIES = (1e-6, 1e-7)
BDF_BUDGET = 6.0  # CPU s
SMOOTH = 0.0  # Hz: the value of rows whose drive follows the course without steps


def command_rates(task: Task) -> list[Row]:
    """Return a row for each solver at one command rate, the task's value [Hz]; SMOOTH for the course itself."""
    content, course = problem(task.scene)

    def build(accuracy: float) -> Simulation:
        simulation = load_scene({**content, "solver": {"accuracy": accuracy}}).build()
        if task.value == SMOOTH:
            follow(simulation, course)
        return simulation

    def run(accuracy: float) -> tuple[np.ndarray, Any]:
        simulation = build(accuracy)
        if task.value == SMOOTH:
            return positions(simulation, TIMES), simulation
        return sampled(simulation, course, task.value, TIMES), simulation

    known, _ = run(REFERENCE)
    cpu, (where, simulation) = best_of(task.runs, lambda: run(ACCURACY))
    counts = simulation.statistics
    ours = Row(
        kind="rate",
        scene=task.scene,
        nodes=simulation.lattice.nodes[0],
        method=simulation.integrator.name,
        setting="rate",
        value=task.value,
        error=float(np.abs(where - known).max()),
        cpu=cpu / PERIOD,
        steps=counts.steps,
        rejected=counts.rejected_steps,
        evaluations=counts.evaluations,
        factorisations=counts.factorisations,
    )
    rivals = Rivals(task, course, known, ours)
    return [ours, *rivals.baseline(), *rivals.scipy(build)]


@dataclass(frozen=True)
class Rivals:
    """What others need for the same course at the same rate.

    Attributes:
        task: What is measured.
        course: What is commanded.
        known: Reference positions at TIMES [m].
        ours: Our row.
    """

    task: Task
    course: DriveProfile
    known: np.ndarray
    ours: Row

    def _row(self, method: str, **values: Any) -> Row:
        return Row("rate", self.ours.scene, self.ours.nodes, method, "rate", self.ours.value, **values)

    def baseline(self) -> list[Row]:
        """Return the compiled loop's row: the longest of its steps that keeps the accuracy; none where it cannot."""
        from ldcs_ros.integrators.spectrum import fastest_mode
        from ldcs_ros.study.baseline import ArcBaseline
        from ldcs_ros.study.problems import scene_of

        rate = self.task.value
        if self.task.scene != "arc_pushed" or rate == SMOOTH or not HAVE_NUMBA:
            return []
        simulation = scene_of("arc", 9).build()
        mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
        for h in (step for step in BASELINE_STEPS if step * rate <= 1.0 + 1e-9):
            solver = ArcBaseline(9, h, mode.spectral_radius)
            solver.run_pushed(TIMES[:1], rate, self.course.at)
            cpu, where = best_of(self.task.runs, lambda: solver.run_pushed(TIMES, rate, self.course.at))  # noqa: B023
            error = float(np.abs(where - self.known).max())
            if error <= ACCURACY:
                steps = round(PERIOD / solver.h)
                text, count = f"dt {h:g}", steps * solver.stages
                return [
                    self._row(
                        BASELINE, error=error, cpu=cpu / PERIOD, steps=steps, evaluations=count, extra=text
                    )
                ]
        return [self._row(BASELINE, failure=f"no step down to {BASELINE_STEPS[-1]:g} s keeps {ACCURACY:g} m")]

    def scipy(self, build: Any) -> list[Row]:
        """Return the row of SciPy's BDF: the first of its tolerances that keeps the accuracy."""
        rate = self.task.value
        for accuracy in BDF_ACCURACIES:
            simulation = build(accuracy)

            def command(count: int, simulation: Simulation = simulation) -> float:
                self.course.send(simulation.inputs, self.course.at(count / rate))
                return (count + 1) / rate

            try:
                cpu, (where, counts) = best_of(
                    1,
                    lambda: solve(
                        simulation,  # noqa: B023
                        "BDF",
                        accuracy,  # noqa: B023
                        TIMES,
                        command=command if rate else None,  # noqa: B023
                        budget=BDF_BUDGET,
                    ),
                )
            except (LdcsError, RuntimeError) as failure:
                return [self._row("scipy_BDF", failure=" ".join(str(failure).split()))]
            error = float(np.abs(where - self.known).max())
            if error <= ACCURACY:
                text = f"tolerance {accuracy:g}"
                return [self._row("scipy_BDF", error=error, cpu=cpu / PERIOD, extra=text, **counts)]
        return [
            self._row(
                "scipy_BDF", failure=f"no tolerance down to {BDF_ACCURACIES[-1]:g} m keeps {ACCURACY:g} m"
            )
        ]


def against_smooth(rows: list[Row]) -> dict[str, dict[float, tuple[float, Row]]]:
    """Return, by problem and command rate [Hz], our speed in speeds of the smooth case, and the row."""
    found: dict[str, dict[float, tuple[float, Row]]] = {}
    ours = [row for row in rows if row.kind == "rate" and not row.failure and row.method.startswith("esdirk")]
    smooth = {row.scene: row for row in ours if row.value == SMOOTH}
    for row in sorted(ours, key=lambda row: (row.scene, row.value)):
        if row.scene in smooth:
            found.setdefault(row.scene, {})[row.value] = smooth[row.scene].cpu / row.cpu, row
    return found

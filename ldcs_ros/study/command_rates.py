"""Cost of command rates: a profile followed smoothly, and sent as steps at a rate; by us, a compiled loop and SciPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.drive_profiles import PERIOD, drive_problem, follow, sampled
from ldcs_ros.study.problems import positions, spectral_radius
from ldcs_ros.study.rows import BASELINE, SCIPY, Row, Task
from ldcs_ros.study.scipy_solvers import solve
from ldcs_ros.study.timing import best_of

ACCURACY, REFERENCE = 1e-5, 1e-7  # m
TIMES = tuple(round(0.02 * k, 2) for k in range(1, round(PERIOD / 0.02) + 1))
BASELINE_STEPS = (0.02, 0.01, 0.005, 0.002, 0.001)
BDF_ACCURACIES = (1e-6, 1e-7)
BDF_BUDGET = 6.0  # CPU s
SMOOTH = 0.0  # Hz: the value of rows whose drive follows the profile without steps


def command_rates(task: Task) -> list[Row]:
    """Return a row for each solver at one command rate, the task's value [Hz]; SMOOTH for the profile itself."""
    competition = Competition(task)
    known, _ = competition.run(REFERENCE)
    cpu, (motion, simulation) = best_of(task.runs, partial(competition.run, ACCURACY))
    row = replace(task.row(), nodes=simulation.lattice.nodes[0], method=simulation.integrator.name)
    ours = row.counted(simulation.statistics).compared(motion, known, cpu, PERIOD)
    rows = [ours, competition.scipy(replace(row, method=SCIPY[0]), known)]
    if task.scene == "arc_pushed" and task.value != SMOOTH and HAVE_NUMBA:
        rows.insert(1, competition.baseline(replace(row, method=BASELINE), known))
    return rows


class Competition:
    """Solvers for the same profile at the same command rate.

    Args:
        task: The measurement.
    """

    def __init__(self, task: Task) -> None:
        self.task, self.rate = task, task.value
        self.content, self.profile = drive_problem(task.scene)

    def build(self, accuracy: float) -> Simulation:
        """Return a simulation with an accuracy [m], whose drive follows the profile itself in the smooth case."""
        simulation = load_scene({**self.content, "solver": {"accuracy": accuracy}}).build()
        if self.rate == SMOOTH:
            follow(simulation, self.profile)
        return simulation

    def run(self, accuracy: float) -> tuple[np.ndarray, Simulation]:
        """Return our positions at TIMES [m], shape (n_times, n_nodes, 3), with an accuracy [m], and the simulation."""
        simulation = self.build(accuracy)
        if self.rate == SMOOTH:
            return positions(simulation, TIMES), simulation
        return sampled(simulation, self.profile, self.rate, TIMES), simulation

    def baseline(self, row: Row, known: np.ndarray) -> Row:
        """Return the compiled loop's row: its longest step that keeps the accuracy against what `run` gave.

        Args:
            row: The row to fill in.
            known: Positions that `run` gave [m], shape (n_times, n_nodes, 3).
        """
        from ldcs_ros.study.baseline import ArcBaseline

        radius = spectral_radius("arc", 9)
        for h in (step for step in BASELINE_STEPS if step * self.rate <= 1.0 + 1e-9):
            solver = ArcBaseline(9, h, radius)
            solver.run_pushed(TIMES[:1], self.rate, self.profile.at)
            run = partial(solver.run_pushed, TIMES, self.rate, self.profile.at)
            cpu, motion = best_of(self.task.runs, run)
            done = solver.counted(row, PERIOD).compared(motion, known, cpu, PERIOD)
            if done.error <= ACCURACY:
                return replace(done, extra=f"dt {h:g}")
        return replace(row, failure=f"no step down to {BASELINE_STEPS[-1]:g} s keeps {ACCURACY:g} m")

    def scipy(self, row: Row, known: np.ndarray) -> Row:
        """Return the row of SciPy's BDF: its first tolerance that keeps the accuracy against what `run` gave.

        Arguments are those of `baseline`.
        """
        for accuracy in BDF_ACCURACIES:
            simulation = self.build(accuracy)
            command = partial(self._command, simulation) if self.rate else None
            run = partial(solve, simulation, "BDF", accuracy, TIMES, command=command, budget=BDF_BUDGET)
            try:
                cpu, (motion, spent) = best_of(1, run)
            except (LdcsError, RuntimeError) as error:
                return replace(row, failure=" ".join(str(error).split()))
            done = row.counted(spent).compared(motion, known, cpu, PERIOD)
            if done.error <= ACCURACY:
                return replace(done, extra=f"tolerance {accuracy:g}")
        return replace(row, failure=f"no tolerance down to {BDF_ACCURACIES[-1]:g} m keeps {ACCURACY:g} m")

    def _command(self, simulation: Simulation, count: int) -> float:
        self.profile.send(simulation.inputs, self.profile.at(count / self.rate))
        return (count + 1) / self.rate


@dataclass(frozen=True)
class RateCost:
    """Our cost at one command rate.

    Attributes:
        row: Our row.
        speed: Speed as a fraction of the smooth case's.
        others: Rows of the other solvers, by method.
    """

    row: Row
    speed: float
    others: dict[str, Row]


def rate_costs(rows: Sequence[Row]) -> dict[tuple[str, float], RateCost]:
    """Return our cost by problem and command rate [Hz], where the smooth case was measured, too."""
    made = [row for row in rows if row.kind == "rate"]
    others: dict[tuple[str, float], dict[str, Row]] = {}
    for row in made:
        others.setdefault((row.scene, row.value), {})[row.method] = row
    ours = [row for row in made if not row.failure and row.method.startswith("esdirk")]
    smooth = {row.scene: row for row in ours if row.value == SMOOTH}
    return {
        (row.scene, row.value): RateCost(row, smooth[row.scene].cpu / row.cpu, others[row.scene, row.value])
        for row in sorted(ours, key=lambda row: (row.scene, row.value))
        if row.scene in smooth
    }

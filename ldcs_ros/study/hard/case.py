"""A hard case, its run step by step with the energy audit, and the checks that a case may ask for."""

from __future__ import annotations

import math
import time as wall_clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators.settings import Solver
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.accuracy.random_scenes import Case
from ldcs_ros.study.accuracy.reference import CACHE, TooSlow, reference, start_velocity
from ldcs_ros.study.hard.audit import EnergyAudit
from ldcs_ros.study.hard.scenes import STARTS

# Residual of the energy audit over the energy moved that is named, in units of the asked accuracy over the sheet's
# length.
AUDIT_FACTOR = 10.0
# Errors in units of the asked accuracy up to which a row is 'within 1' and 'within 3'.
FACTORS = (1.0, 3.0)
SAMPLES = 40
# Processor time that an independent reference may take [s].
REFERENCE_SECONDS = 20.0
FINEST = 1e-10  # m, the smallest accuracy that a scene may ask for


@dataclass(frozen=True)
class CaseRun:
    """A finished run of a case.

    Attributes:
        simulation: The simulation at its end.
        positions: Node positions at the sample times [m], shape (n, n_nodes, 3).
        audit: The energy audit, or None.
        memory_growth: Growth of the process's memory over the run's second half [byte].
    """

    simulation: Simulation
    positions: np.ndarray
    audit: EnergyAudit | None
    memory_growth: int


@dataclass(frozen=True)
class CaseComparison:
    """The comparison of a run with what it should have been.

    Attributes:
        error: Largest Euclidean distance of a node [m]; NaN without a comparison.
        reference: What it was compared with, in a few words.
    """

    error: float
    reference: str


def largest_distance(positions: np.ndarray, others: np.ndarray) -> float:
    """Return the largest Euclidean distance of a node [m] of positions of shape (..., n_nodes, 3)."""
    return float(np.nanmax(np.linalg.norm(positions - others, axis=-1)))


def finer_run(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare with the same method at a hundredth of the asked accuracy; a fixed step with `esdirk43` at 1e-7 m."""
    scene = load_scene(case.scene)
    if case.accuracy is None:
        solver = Solver("esdirk43", 1e-7)
    else:
        solver = Solver(scene.solver.integrator, max(FINEST, 0.01 * case.accuracy))
    fine = run_samples(case.start_simulation(solver), case.sample_times, 10.0 * case.timeout, audited=False)
    words = "esdirk43 at 1e-7 m" if case.accuracy is None else "1/100 of the accuracy"
    return CaseComparison(largest_distance(run.positions, fine.positions), words)


def independent(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare with SciPy's Radau or DOP853 on accelerations that share no code; too slow: with a finer run."""
    content = {key: value for key, value in case.scene.items() if key != "solver"}
    alone = Case(case.name, content, case.duration, case.spin, case.drift, looks=len(case.sample_times))
    try:
        truth = reference(alone, cache=CACHE, seconds=REFERENCE_SECONDS)
    except (TooSlow, ArithmeticError):
        return finer_run(case, run)
    return CaseComparison(largest_distance(run.positions, truth), "SciPy")


def own_equilibrium(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare the end with the equilibrium that the scene's own start finds."""
    other = load_scene(case.scene).build()
    other.settle()
    return CaseComparison(
        largest_distance(run.simulation.state.position, other.state.position), "equilibrium"
    )


def nearest_equilibrium(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare the end with the equilibrium in whose basin the run ended.

    Springs along their axes have mirrored equilibria beside the scene's own.
    """
    other, state = load_scene(case.scene).build(), run.simulation.state
    arms = {"link_angle": state.link_angle} if state.link_angle.size else {}
    other.start_from(state.position, **arms)
    other.settle()
    return CaseComparison(largest_distance(state.position, other.state.position), "nearest equilibrium")


def repetition(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare the samples with their mean: cycles with each other, or a sheet at rest with itself."""
    mean = np.broadcast_to(run.positions.mean(axis=0), run.positions.shape)
    return CaseComparison(2.0 * largest_distance(run.positions, mean), "itself")


def nothing(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare nothing: the run stays within its reach and keeps its energy.

    Raises:
        DivergenceError: It did not.
    """
    if run.audit is not None and not run.audit.relative <= case.audit_limit:
        raise DivergenceError(f"the energy audit is above {case.audit_limit:.2g}")
    return CaseComparison(math.nan, "-")


@dataclass(frozen=True)
class HardCase:
    """One row of the catalogue.

    Attributes:
        name: Unique name.
        scene: The scene as a dict, as `load_scene` takes it.
        duration: Simulated time [s].
        reason: What is special about it, for the page.
        check: Function that compares a run.
        spin: Angular velocity of the whole sheet at the start [rad/s].
        drift: Linear velocity of the whole sheet at the start [m/s].
        reach: Largest accepted distance of a node from the origin along an axis [m].
        sample_from: Start of the comparison [s].
        period: Interval of the samples [s]; 0 for SAMPLES in the whole comparison.
        memory: Largest accepted growth of the process's memory [byte].
        refusal: Pattern of the message of a scene that must be refused; '' for a scene that must run.
        start: Name in `STARTS` of the shape to start from; '' for the scene's own.
        fast: Part of the default tests.
        slow: Left out unless asked for.
        timeout: Wall time after which a run counts as wrong [s].
    """

    name: str
    scene: dict[str, Any] = field(repr=False)
    duration: float
    reason: str = ""
    check: Callable[[HardCase, CaseRun], CaseComparison] = finer_run
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach: float = math.inf
    sample_from: float = 0.0
    period: float = 0.0
    memory: float = math.inf
    refusal: str = ""
    start: str = ""
    fast: bool = False
    slow: bool = False
    timeout: float = 120.0

    @property
    def accuracy(self) -> float | None:
        """The asked accuracy [m], None with a fixed step."""
        solver = self.scene.get("solver", {})
        return None if "dt" in solver else float(solver.get("accuracy", 1e-5))

    @property
    def audit_limit(self) -> float:
        """Relative residual of the energy audit above which a row says so; infinite with a fixed step."""
        length: float = self.scene["lattice"]["size"][0]
        return math.inf if self.accuracy is None else AUDIT_FACTOR * self.accuracy / length

    @property
    def sample_times(self) -> list[float]:
        """Times of the comparison [s], the last at the end."""
        span = self.duration - self.sample_from
        count = round(span / self.period) if self.period else SAMPLES
        return [self.sample_from + span * k / count for k in range(1, count + 1)]

    def start_simulation(self, solver: Solver | None = None) -> Simulation:
        """Return the simulation at its start, with another solver if one is given."""
        scene = load_scene(self.scene)
        simulation = (scene if solver is None else replace(scene, solver=solver)).build()
        velocity = start_velocity(
            Case(self.name, self.scene, self.duration, self.spin, self.drift),
            scene.lattice.reference_position,
        )
        if self.start or velocity is not None:
            shape = STARTS[self.start](scene.lattice) if self.start else scene.lattice.reference_position
            simulation.start_from(shape, velocity)
        return simulation


def run_samples(
    simulation: Simulation, sample_times: Sequence[float], timeout: float, *, audited: bool
) -> CaseRun:
    """Advance a simulation step by step through sample times [s] and collect its positions there.

    Raises:
        DivergenceError: The simulation stopped.
        TimeoutError: The run took longer than `timeout` [s].
    """
    audit = EnergyAudit(simulation.model, simulation.last_step.right) if audited else None
    deadline = wall_clock.monotonic() + timeout
    duration, pending = sample_times[-1], list(sample_times)
    positions, seen, memory = [], None, 0
    while simulation.time < duration:
        after_step = max(simulation.last_step.right.time, simulation.time) + 2.0 * TIME_TOLERANCE
        simulation.advance_to(min([after_step, *pending[:1]]))
        if audit is not None and simulation.last_step is not seen:
            seen = simulation.last_step
            audit.follow(seen, duration, simulation.inputs.held())
        if pending and simulation.time >= pending[0]:
            positions.append(simulation.state.position)
            pending.pop(0)
        if not memory and simulation.time > 0.5 * duration:
            memory = _memory()
        if wall_clock.monotonic() > deadline:
            raise TimeoutError(f"no end after {timeout:g} s of computing, at t = {simulation.time:.6g} s")
    return CaseRun(simulation, np.array(positions), audit, _memory() - memory)


def _memory() -> int:
    """Return the process's resident memory [byte]; 0 on systems without the figure."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
    except (OSError, ValueError, IndexError):
        return 0

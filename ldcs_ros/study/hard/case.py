"""A hard case, its run step by step with the energy audit, and the checks that a case may ask for."""

from __future__ import annotations

import hashlib
import json
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
from ldcs_ros.study.accuracy.reference import CACHE, TooSlow, equilibrium, reference, start_velocity
from ldcs_ros.study.hard.audit import EnergyAudit
from ldcs_ros.study.hard.scenes import STARTS

# Residual of the energy audit over the energy moved that is named, in units of the asked accuracy over the sheet's
# length.
AUDIT_FACTOR = 10.0
# Errors in units of the asked accuracy up to which a row is 'within 1' and 'within 3'.
FACTORS = (1.0, 3.0)
SAMPLES = 40
# Processor times that a run and an independent reference may take [s].
RUN_SECONDS, REFERENCE_SECONDS = 100.0, 10.0
# Asked accuracy of the reference of a case with a fixed step [m].
FIXED_STEP = 1e-5
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
    """Compare with the default method at a hundredth of the asked accuracy."""
    solver = Solver("auto", max(FINEST, 0.01 * (case.accuracy or FIXED_STEP)))
    fine = run_samples(case.start_simulation(solver), case.sample_times, RUN_SECONDS, audited=False)
    return CaseComparison(largest_distance(run.positions, fine.positions), "finer run")


def independent(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare with SciPy's Radau or DOP853 on accelerations that share no code; too slow: with a finer run.

    A larger error than asked is compared again with a reference of a thousandth of the tolerance: it may be the
    reference's own.
    """
    content = {key: value for key, value in case.scene.items() if key != "solver"}
    start = STARTS[case.start](run.simulation.lattice) if case.start else np.empty((0, 3))
    alone = Case(
        case.name,
        content,
        case.duration,
        case.spin,
        case.drift,
        looks=len(case.sample_times),
        start=tuple(map(tuple, start.tolist())),
    )
    asked, error = case.accuracy or FIXED_STEP, math.inf
    for tolerance in (0.1 * asked, 1e-4 * asked):
        try:
            truth = reference(alone, cache=CACHE, seconds=case.reference_seconds, tolerance=tolerance)
        except (TooSlow, ArithmeticError):
            return finer_run(case, run)
        error = largest_distance(run.positions, truth)
        if error <= asked:
            break
    return CaseComparison(error, "SciPy")


def own_equilibrium(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare the end with the equilibrium near the one that the scene's own start finds."""
    other = load_scene(case.scene).build()
    other.settle()
    return _from_equilibrium(case, run, other)


def nearest_equilibrium(case: HardCase, run: CaseRun) -> CaseComparison:
    """Compare the end with the equilibrium nearest to it.

    Springs along their axes have mirrored equilibria beside the scene's own.
    """
    return _from_equilibrium(case, run, run.simulation)


def _from_equilibrium(case: HardCase, run: CaseRun, near: Simulation) -> CaseComparison:
    state = near.state
    alone = Case(case.name, case.scene, case.duration)
    try:
        rest = equilibrium(alone, state.position, state.link_angle)
    except ArithmeticError as error:
        raise DivergenceError(str(error)) from error
    return CaseComparison(largest_distance(run.simulation.state.position, rest), "equilibrium")


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
        reference_seconds: Processor time that the reference may take [s].
    """

    name: str
    scene: dict[str, Any] = field(repr=False)
    duration: float
    reason: str = ""
    check: Callable[[HardCase, CaseRun], CaseComparison] = independent
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach: float = math.inf
    sample_from: float = 0.0
    period: float = 0.0
    memory: float = math.inf
    refusal: str = ""
    start: str = ""
    reference_seconds: float = REFERENCE_SECONDS

    @property
    def accuracy(self) -> float | None:
        """The asked accuracy [m], None with a fixed step."""
        solver = self.scene.get("solver", {})
        return None if "dt" in solver else float(solver.get("accuracy", 1e-5))

    @property
    def key(self) -> str:
        """A digest of what a run depends on: a row of another scene under this name is measured again."""
        content = [
            self.scene,
            self.duration,
            self.spin,
            self.drift,
            self.start,
            self.sample_from,
            self.period,
        ]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:8]

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
        shape = STARTS[self.start](scene.lattice) if self.start else scene.lattice.reference_position
        velocity = start_velocity(Case(self.name, self.scene, self.duration, self.spin, self.drift), shape)
        if self.start or velocity is not None:
            simulation.start_from(shape, velocity)
        return simulation


def run_samples(
    simulation: Simulation, sample_times: Sequence[float], seconds: float, *, audited: bool
) -> CaseRun:
    """Advance a simulation step by step through sample times [s] and collect its positions there.

    Raises:
        DivergenceError: The simulation stopped.
        TimeoutError: The run took more than `seconds` of processor time.
    """
    audit = EnergyAudit(simulation.model, simulation.last_step.right) if audited else None
    deadline = wall_clock.process_time() + seconds
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
        if wall_clock.process_time() > deadline:
            raise TimeoutError(f"no end after {seconds:g} s of computing, at t = {simulation.time:.6g} s")
    return CaseRun(simulation, np.array(positions), audit, _memory() - memory)


def _memory() -> int:
    """Return the process's resident memory [byte]; 0 on systems without the figure."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
    except (OSError, ValueError, IndexError):
        return 0

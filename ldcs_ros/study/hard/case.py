"""A hard case, its run step by step with the energy audit, and the checks that a case may ask for."""

from __future__ import annotations

import math
import time as wall_clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.integrators.settings import Solver
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.hard.audit import EnergyAudit
from ldcs_ros.study.hard.scenes import STARTS

# Largest residual of the energy audit over the energy moved, in units of the asked accuracy over the sheet's length.
AUDIT_FACTOR = 10.0
# Largest error in units of the asked accuracy.
MAX_FACTOR = 3.0
SAMPLES = 40
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


def reference_error(case: HardCase, run: CaseRun) -> float:
    """Return the largest error of a node coordinate [m] against a hundredth of the asked accuracy.

    The reference of a case with a fixed step is `esdirk43` at 1e-7 m.
    """
    scene = load_scene(case.scene)
    if case.accuracy is None:
        solver = Solver("esdirk43", 1e-7)
    else:
        solver = Solver(scene.solver.integrator, max(FINEST, 0.01 * case.accuracy))
    fine = run_samples(case.start_simulation(solver), case.sample_times, 10.0 * case.timeout, audited=False)
    return float(np.abs(run.positions - fine.positions).max())


def rest_error(case: HardCase, run: CaseRun) -> float:
    """Return the largest distance of a node coordinate [m] from the equilibrium that the scene's own start finds."""
    other = load_scene(case.scene).build()
    other.settle()
    return float(np.abs(other.state.position - run.simulation.state.position).max())


def nearest_rest_error(case: HardCase, run: CaseRun) -> float:
    """Return the largest distance of a node coordinate [m] from the equilibrium in whose basin the run ended.

    Springs along their axes have mirrored equilibria beside the scene's own.
    """
    other, state = load_scene(case.scene).build(), run.simulation.state
    arms = {"link_angle": state.link_angle} if state.link_angle.size else {}
    other.start_from(state.position, **arms)
    other.settle()
    return float(np.abs(other.state.position - state.position).max())


def peak_to_peak(case: HardCase, run: CaseRun) -> float:
    """Return the largest peak-to-peak motion of a node coordinate over the samples [m]; one a cycle compares cycles."""
    return float(np.ptp(run.positions, axis=0).max())


def no_error(case: HardCase, run: CaseRun) -> float:
    """Return NaN: nothing is compared, the run stays within its reach."""
    return math.nan


@dataclass(frozen=True)
class HardCase:
    """One row of the catalogue.

    Attributes:
        name: Unique name.
        scene: The scene as a dict, as `load_scene` takes it.
        duration: Simulated time [s].
        reason: Reason for a limit that is not the default.
        check: Function that returns the error to compare with the limit.
        limit: Largest accepted error [m]; None for MAX_FACTOR times the asked accuracy.
        reach: Largest accepted distance of a node from the origin along an axis [m].
        sample_from: Start of the comparison [s].
        period: Interval of the samples [s]; 0 for SAMPLES in the whole comparison.
        memory: Largest accepted growth of the process's memory [byte].
        refusal: Pattern of the message of a scene that must be refused; '' for a scene that must run.
        start: Name in `STARTS` of the shape to start from; '' for the scene's own.
        audit: Largest relative residual of the energy audit; None for AUDIT_FACTOR times the asked accuracy over the
            sheet's length, infinite for cases of negligible energy.
        fast: Part of the default tests.
        timeout: Wall time after which a run counts as wrong [s].
    """

    name: str
    scene: dict[str, Any] = field(repr=False)
    duration: float
    reason: str = ""
    check: Callable[[HardCase, CaseRun], float] = reference_error
    limit: float | None = None
    reach: float = math.inf
    sample_from: float = 0.0
    period: float = 0.0
    memory: float = math.inf
    refusal: str = ""
    start: str = ""
    audit: float | None = None
    fast: bool = False
    timeout: float = 120.0

    @property
    def accuracy(self) -> float | None:
        """The asked accuracy [m], None with a fixed step."""
        solver = self.scene.get("solver", {})
        return None if "dt" in solver else float(solver.get("accuracy", 1e-5))

    @property
    def error_limit(self) -> float:
        """Largest accepted error [m]."""
        if self.limit is not None:
            return self.limit
        return math.inf if self.accuracy is None else MAX_FACTOR * self.accuracy

    @property
    def audit_limit(self) -> float:
        """Largest accepted relative residual of the energy audit."""
        if self.audit is not None:
            return self.audit
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
        if self.start:
            simulation.start_from(STARTS[self.start](scene.lattice))
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

"""One runner for all hard cases: builds, starts, marches step by step with the audit, and judges the outcome."""

from __future__ import annotations

import math
import re
import time as wall_clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ldcs_ros.errors import DivergenceError, LdcsError
from ldcs_ros.integrators.settings import Solver
from ldcs_ros.scene import load_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.hard.audit import EnergyAudit
from ldcs_ros.study.hard.case import PROMISE, Bounded, HardCase, Periodic, Reference, Refused, Rest, Still
from ldcs_ros.study.hard.starts import STARTS

LOOKS = 40  # times at which a run is compared
FINEST = 1e-10  # m, the smallest accuracy that a scene may ask for


@dataclass(frozen=True)
class Row:
    """What came of a case.

    Attributes:
        case: The case.
        outcome: 'right', 'refused' (stopped with a reason) or 'wrong'.
        error: Worst error of a node against what is right [m]; NaN where nothing is compared.
        audit: Relative residual of the energy audit; NaN without one.
        steps: Accepted steps.
        rejected_steps: Steps taken again.
        pace: Simulated seconds per second of computing.
        note: Why it was refused or is wrong.
    """

    case: HardCase
    outcome: str
    error: float = math.nan
    audit: float = math.nan
    steps: int = 0
    rejected_steps: int = 0
    pace: float = math.nan
    note: str = ""


class Stuck(Exception):
    """A run has used up its case's patience."""


@dataclass(frozen=True)
class DriveProfile:
    """What a run went through.

    Attributes:
        times: Times of the looks [s], shape (n,).
        positions: Node positions then [m], shape (n, n_nodes, 3).
        audit: The energy audit, or None.
        memory: Growth of the process's memory over the run's second half [byte].
    """

    times: np.ndarray
    positions: np.ndarray
    audit: EnergyAudit | None
    memory: int


def run_case(case: HardCase) -> Row:
    """Run one case and judge it; never raises for what a case may do."""
    try:
        simulation = _started(case, load_scene(case.scene))
    except LdcsError as error:
        return _refusal(case, error)
    if isinstance(case.right, Refused):
        return Row(case, "wrong", note=f"was built; expected a refusal with {case.right.words!r}")
    try:
        course = march(simulation, case.duration, _looks(case), case.patience, audited=True)
    except DivergenceError as error:
        return _measured(Row(case, "refused", note=str(error)), simulation)
    except Stuck:
        note = f"stuck at t = {simulation.time:.6g} s after {case.patience:g} s of computing"
        return _measured(Row(case, "wrong", note=note), simulation)
    return _measured(_judge(case, simulation, course), simulation)


def march(
    simulation: Simulation, duration: float, looks: Sequence[float], patience: float, *, audited: bool
) -> DriveProfile:
    """Advance a simulation step by step and collect its positions at the looks.

    Raises:
        DivergenceError: The simulation stopped.
        Stuck: It took longer than `patience` [s].
    """
    audit = EnergyAudit(simulation.model, simulation.last_step.right) if audited else None
    deadline = wall_clock.monotonic() + patience
    positions, pending, seen, memory = [], list(looks), None, 0
    while simulation.time < duration:
        step = simulation.last_step
        beyond = max(step.right.time, simulation.time) + 2.0 * TIME_TOLERANCE
        simulation.advance_to(min([beyond, duration, *pending[:1]]))
        if audit is not None and simulation.last_step is not seen:
            seen = simulation.last_step
            audit.follow(seen, duration, simulation.inputs.held())
        if pending and simulation.time >= pending[0]:
            positions.append(simulation.state.position)
            pending.pop(0)
        if not memory and simulation.time > 0.5 * duration:
            memory = _memory()
        if wall_clock.monotonic() > deadline:
            raise Stuck
    return DriveProfile(np.array(looks), np.array(positions), audit, _memory() - memory)


def _started(case: HardCase, scene: Scene) -> Simulation:
    simulation = scene.build()
    if case.start:
        simulation.start_from(STARTS[case.start](scene.lattice))
    return simulation


def _looks(case: HardCase) -> list[float]:
    if isinstance(case.right, Periodic):
        count = round((case.duration - case.right.after) / case.right.period)
        return [case.right.after + k * case.right.period for k in range(1, count + 1)]
    first = case.right.after if isinstance(case.right, Still) else 0.0
    return list(np.linspace(first, case.duration, LOOKS + 1)[1:])


def _refusal(case: HardCase, error: LdcsError) -> Row:
    expected = isinstance(case.right, Refused)
    if isinstance(case.right, Refused) and not re.search(case.right.words, str(error)):
        return Row(case, "wrong", note=f"refused without {case.right.words!r}: {error}")
    return Row(case, "refused" if expected else "wrong", note=str(error))


def _measured(row: Row, simulation: Simulation) -> Row:
    spent = simulation.statistics
    pace = simulation.time / spent.wall_time if spent.wall_time > 0.0 else math.nan
    return replace(row, steps=spent.steps, rejected_steps=spent.rejected_steps, pace=pace)


def _judge(case: HardCase, simulation: Simulation, course: DriveProfile) -> Row:
    audit = course.audit.relative if course.audit is not None else math.nan
    if not np.isfinite(course.positions).all():
        return Row(case, "wrong", audit=audit, note="a position is not finite")
    try:
        error, bound = _compare(case, simulation, course)
    except DivergenceError as failure:
        return Row(case, "wrong", audit=audit, note=f"the reference stopped: {failure}")
    notes = []
    if error > bound:
        notes.append(f"error above {bound:.2g} m")
    if not audit <= case.audit_bound:
        notes.append(f"audit above {case.audit_bound:.2g}")
    if isinstance(case.right, Periodic) and course.memory > case.right.growth:
        notes.append(f"memory grew by {course.memory} bytes")
    return Row(case, "wrong" if notes else "right", error, audit, note="; ".join(notes))


def _compare(case: HardCase, simulation: Simulation, course: DriveProfile) -> tuple[float, float]:
    """Return the worst error [m] and its bound."""
    right = case.right
    if isinstance(right, Reference):
        accuracy = case.accuracy or 1e-5
        fine = _fine(case, max(FINEST, right.finer * accuracy), right.method)
        return float(np.abs(course.positions - fine).max()), right.bound or PROMISE * accuracy
    if isinstance(right, Rest):
        return _distance_from_rest(case, simulation, right), right.bound
    if isinstance(right, Still):
        return float(np.ptp(course.positions, axis=0).max()), right.limit
    if isinstance(right, Periodic):
        return float(np.ptp(course.positions, axis=0).max()), right.limit
    assert isinstance(right, Bounded)
    if float(np.abs(course.positions).max()) > right.limit:
        return math.inf, right.limit
    if not right.reference:
        return math.nan, math.nan
    return float(np.abs(course.positions - _fine(case, 1e-7, right.reference)).max()), math.inf


def _fine(case: HardCase, accuracy: float, method: str) -> np.ndarray:
    scene = load_scene(case.scene)
    solver = Solver(method or scene.solver.integrator, accuracy)
    simulation = _started(case, replace(scene, solver=solver))
    course = march(simulation, case.duration, _looks(case), 10.0 * case.patience, audited=False)
    return course.positions


def _distance_from_rest(case: HardCase, simulation: Simulation, right: Rest) -> float:
    other = load_scene(case.scene).build()
    if right.shape == "nearest":
        state = simulation.state
        arms = {"link_angle": state.link_angle} if state.link_angle.size else {}
        other.start_from(state.position, **arms)
    other.settle()
    return float(np.abs(other.state.position - simulation.state.position).max())


def _memory() -> int:
    """Return the process's resident memory [byte]; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
    except (OSError, ValueError, IndexError):
        return 0

"""Runs hard cases and judges them by their error: within 1, within 3, or missed."""

from __future__ import annotations

import math
import re
import time as wall_clock
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from ldcs_ros.errors import DivergenceError, LdcsError
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.hard.case import FACTORS, RUN_SECONDS, CaseRun, HardCase, run_samples


@dataclass(frozen=True)
class CaseResult:
    """The judgement of a case.

    Attributes:
        case: The case.
        outcome: 'within 1', 'within 3' or 'missed' by the error in units of the asked accuracy; 'bounded' where
            nothing is asked or compared; 'stopped' with the expected reason.
        error: Largest distance of a node from the reference [m]; NaN without a comparison.
        estimate: Error that the run itself states [m]; NaN with a fixed step.
        reference: What the run was compared with.
        audit: Relative residual of the energy audit; NaN without one.
        steps: Accepted steps.
        rejected_steps: Steps taken again.
        pace: Simulated seconds per second of computing.
        cpu: Processor time of run, audit and reference [s].
        note: Reason of a missed or stopped row, and an energy audit above its usual size.
    """

    case: HardCase
    outcome: str
    error: float = math.nan
    estimate: float = math.nan
    reference: str = "-"
    audit: float = math.nan
    steps: int = 0
    rejected_steps: int = 0
    pace: float = math.nan
    cpu: float = math.nan
    note: str = ""


def run_cases(
    cases: Sequence[HardCase], *, jobs: int = 1, on_result: Callable[[CaseResult], None] = lambda result: None
) -> list[CaseResult]:
    """Run cases and return their results in order.

    Args:
        cases: The cases.
        jobs: Processes; with more than one, times are noisier.
        on_result: Called with each result as it comes.
    """
    results = []
    for result in _results(cases, jobs):
        on_result(result)
        results.append(result)
    return results


def _results(cases: Sequence[HardCase], jobs: int) -> Iterator[CaseResult]:
    if jobs == 1:
        yield from map(run_case, cases)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(run_case, cases)


def run_case(case: HardCase) -> CaseResult:
    """Run one case and judge it; a failure of the case raises nothing."""
    started = wall_clock.process_time()
    result = _run_and_judge(case)
    return replace(result, cpu=wall_clock.process_time() - started)


def _run_and_judge(case: HardCase) -> CaseResult:
    try:
        simulation = case.start_simulation()
    except LdcsError as error:
        if not case.refusal:
            return CaseResult(case, "missed", note=str(error))
        if not re.search(case.refusal, str(error)):
            return CaseResult(case, "missed", note=f"refused without {case.refusal!r}: {error}")
        return CaseResult(case, "stopped", note=str(error))
    if case.refusal:
        return CaseResult(case, "missed", note=f"was built; expected a refusal with {case.refusal!r}")
    try:
        result = _judge(case, run_samples(simulation, case.sample_times, RUN_SECONDS, audited=True))
    except DivergenceError as error:
        result = CaseResult(case, "stopped", note=str(error))
    except TimeoutError as error:
        result = CaseResult(case, "missed", note=str(error))
    return _measured(result, simulation)


def _judge(case: HardCase, run: CaseRun) -> CaseResult:
    audit = run.audit.relative if run.audit is not None else math.nan
    if not np.isfinite(np.where(_missing(run), 0.0, run.positions)).all():
        return CaseResult(case, "missed", audit=audit, note="a position is not finite")
    try:
        found = case.check(case, run)
    except DivergenceError as failure:
        return CaseResult(case, "missed", audit=audit, note=str(failure))
    outcome, notes = "bounded", []
    if case.accuracy is not None and math.isfinite(found.error):
        factor = found.error / case.accuracy
        outcome = next((f"within {limit:g}" for limit in FACTORS if factor <= limit), "missed")
        if outcome == "missed":
            notes.append(f"{factor:.2g} times the asked accuracy")
    if float(np.nanmax(np.abs(run.positions))) > case.reach:
        outcome = "missed"
        notes.append(f"a node left the reach of {case.reach:g} m")
    if run.memory_growth > case.memory:
        outcome = "missed"
        notes.append(f"memory grew by {run.memory_growth} bytes")
    if not audit <= case.audit_limit:
        notes.append(f"energy audit above {case.audit_limit:.2g}")
    return CaseResult(
        case, outcome, found.error, reference=found.reference, audit=audit, note="; ".join(notes)
    )


def _missing(run: CaseRun) -> np.ndarray:
    # Nodes of holes have no position; shape (n_nodes, 1).
    lattice = run.simulation.lattice
    return np.isin(np.arange(lattice.n_nodes), lattice.missing)[:, None]


def _measured(result: CaseResult, simulation: Simulation) -> CaseResult:
    spent = simulation.statistics
    pace = simulation.time / spent.wall_time if spent.wall_time > 0.0 else math.nan
    estimate = math.nan if result.case.accuracy is None else spent.error_estimate
    return replace(
        result, estimate=estimate, steps=spent.steps, rejected_steps=spent.rejected_steps, pace=pace
    )

"""Runs hard cases and judges them: right, refused or wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from ldcs_ros.errors import DivergenceError, LdcsError
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.hard.case import CaseRun, HardCase, run_samples


@dataclass(frozen=True)
class CaseResult:
    """The judgement of a case.

    Attributes:
        case: The case.
        outcome: 'right', 'refused' (stopped with a reason) or 'wrong'.
        error: Error that the case's check returns [m]; NaN without a comparison.
        audit: Relative residual of the energy audit; NaN without one.
        steps: Accepted steps.
        rejected_steps: Steps taken again.
        pace: Simulated seconds per second of computing.
        note: Reason of another outcome than 'right'.
    """

    case: HardCase
    outcome: str
    error: float = math.nan
    audit: float = math.nan
    steps: int = 0
    rejected_steps: int = 0
    pace: float = math.nan
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
    try:
        simulation = case.start_simulation()
    except LdcsError as error:
        if not case.refusal:
            return CaseResult(case, "wrong", note=str(error))
        if not re.search(case.refusal, str(error)):
            return CaseResult(case, "wrong", note=f"refused without {case.refusal!r}: {error}")
        return CaseResult(case, "refused", note=str(error))
    if case.refusal:
        return CaseResult(case, "wrong", note=f"was built; expected a refusal with {case.refusal!r}")
    try:
        result = _judge(case, run_samples(simulation, case.sample_times, case.timeout, audited=True))
    except DivergenceError as error:
        result = CaseResult(case, "refused", note=str(error))
    except TimeoutError as error:
        result = CaseResult(case, "wrong", note=str(error))
    return _measured(result, simulation)


def _judge(case: HardCase, run: CaseRun) -> CaseResult:
    audit = run.audit.relative if run.audit is not None else math.nan
    if not np.isfinite(run.positions).all():
        return CaseResult(case, "wrong", audit=audit, note="a position is not finite")
    try:
        error = case.check(case, run)
    except DivergenceError as failure:
        return CaseResult(case, "wrong", audit=audit, note=f"the reference stopped: {failure}")
    notes = []
    if error > case.error_limit:
        notes.append(f"error above {case.error_limit:.2g} m")
    if float(np.abs(run.positions).max()) > case.reach:
        notes.append(f"a node left the reach of {case.reach:g} m")
    if not audit <= case.audit_limit:
        notes.append(f"audit above {case.audit_limit:.2g}")
    if run.memory_growth > case.memory:
        notes.append(f"memory grew by {run.memory_growth} bytes")
    return CaseResult(case, "wrong" if notes else "right", error, audit, note="; ".join(notes))


def _measured(result: CaseResult, simulation: Simulation) -> CaseResult:
    spent = simulation.statistics
    pace = simulation.time / spent.wall_time if spent.wall_time > 0.0 else math.nan
    return replace(result, steps=spent.steps, rejected_steps=spent.rejected_steps, pace=pace)

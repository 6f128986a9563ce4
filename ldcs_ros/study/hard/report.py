"""The table of hard cases, for terminals and for docs/hard_cases.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ldcs_ros.study.hard.case import AUDIT_FACTOR, FACTORS, REFERENCE_SECONDS
from ldcs_ros.study.hard.catalogue import CASES, CHAPTERS
from ldcs_ros.study.hard.runner import CaseResult
from ldcs_ros.study.report import markdown_table

COLUMNS = (
    "case",
    "asked accuracy [m]",
    "outcome",
    "worst error [m]",
    "estimate / error",
    "reference",
    "energy audit",
    "steps",
    "rejected",
    "x real time",
    "CPU [s]",
)


def cells(result: CaseResult) -> tuple[str, ...]:
    """Return the cells of a result in the order of `COLUMNS`."""
    solver = result.case.scene.get("solver", {})
    asked = f"{result.case.accuracy:.0e}" if result.case.accuracy is not None else f"dt = {solver['dt']:g} s"
    return (
        result.case.name,
        asked,
        result.outcome,
        _number(result.error, ".1e"),
        _number(result.estimate / result.error, ".2g") if result.error else "-",
        result.reference,
        _number(result.audit, ".1e"),
        str(result.steps),
        str(result.rejected_steps),
        _number(result.pace, ".3g"),
        _number(result.cpu, ".1f"),
    )


def as_text(result: CaseResult) -> str:
    """Return one line for a terminal."""
    name, *rest = cells(result)
    line = f"{name:<58} " + " ".join(
        f"{cell:>{width}}" for cell, width in zip(rest, (10, 8, 8, 6, 12, 8, 7, 6, 8, 6), strict=True)
    )
    return f"{line}  {result.note}".rstrip()


def summary(results: Sequence[CaseResult]) -> str:
    """Return one sentence with the counts."""
    outcomes = (*(f"within {limit:g}" for limit in FACTORS), "missed", "bounded", "stopped")
    count = {outcome: sum(result.outcome == outcome for result in results) for outcome in outcomes}
    alone = sum(result.reference in ("SciPy", "equilibrium") for result in results)
    spent = sum(result.cpu for result in results) / 60.0
    counts = ", ".join(f"{number} {outcome}" for outcome, number in count.items())
    return (
        f"{len(results)} of {len(CASES)} cases: {counts}; "
        f"{alone} have a reference that shares no code with the solver; {spent:.0f} minutes of processor time."
    )


def write_page(results: Sequence[CaseResult], folder: Path, *, machine: dict[str, str], command: str) -> Path:
    """Write hard_cases.md into a folder and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "hard_cases.md"
    path.write_text(as_markdown(results, machine=machine, command=command), encoding="utf-8")
    return path


def as_markdown(results: Sequence[CaseResult], *, machine: dict[str, str], command: str) -> str:
    """Return the whole page."""
    by_name = {result.case.name: result for result in results}
    parts = [
        "# Hard cases",
        f"Written by `{command}`. {summary(results)}",
        "Each case is a scene as data in `ldcs_ros/study/hard/`. *Worst error*: the largest Euclidean distance of any "
        "node at any of 40 times from the reference. An error of at most the asked accuracy is *within 1*, of at most "
        "3 times it *within 3*, a larger one *missed*; no case has a bound of its own. *Bounded*: a fixed step has no "
        "asked accuracy, and a chaotic motion no reference; it stayed within reach. *Stopped*: it ended with the "
        "diagnosis that belongs to it.",
        "References: *SciPy*: Radau or DOP853 on accelerations that share no code with the solver "
        "(`ldcs_ros/study/accuracy`), with a tolerance of a tenth of the asked accuracy, and of a ten thousandth where "
        "the error is larger than asked. *Finer run*: the solver at 1/100 of the accuracy, where SciPy takes more than "
        f"{REFERENCE_SECONDS:g} s of processor time. *Equilibrium*: the end of the run against Newton's iteration on "
        "the same accelerations. *Itself*: cycles, or a sheet at rest, against their mean. *Estimate / error*: the "
        "error that the run itself stated over the real one; a missed row with 0.67 and more said so.",
        "*Energy audit*: the largest residual of kinetic + elastic + gravity + dissipated energy - work of inputs "
        f"and drives, over the energy moved; one above {AUDIT_FACTOR:g} times the asked accuracy over the sheet's "
        "length is named below its table. *Rejected* steps were taken again, shorter. Times are from one run on a "
        "shared machine: " + ", ".join(f"{name} {value}" for name, value in machine.items()) + ".",
    ]
    left_out_chapters: list[str] = []
    for chapter, cases in CHAPTERS.items():
        shown = [by_name[case.name] for case in cases if case.name in by_name]
        if not shown:
            left_out_chapters.append(chapter)
            continue
        parts += [f"## {chapter}", markdown_table(COLUMNS, map(cells, shown))]
        remarks: dict[str, list[str]] = {}
        for result in shown:
            for remark in filter(None, (result.case.reason, result.note)):
                remarks.setdefault(remark, []).append(result.case.name)
        left_out = [case.name for case in cases if case.name not in by_name]
        if left_out:
            remarks["not run here; `ldcs study --hard` goes on with them"] = left_out
        if remarks:
            parts.append("\n".join(f"- {'; '.join(names)}: {remark}." for remark, names in remarks.items()))
    if left_out_chapters:
        names = ", ".join(left_out_chapters)
        parts.append(f"Chapters without a run so far: {names}. The same command goes on with them.")
    return "\n\n".join(parts) + "\n"


def _number(value: float, style: str) -> str:
    return format(value, style) if math.isfinite(value) else "-"

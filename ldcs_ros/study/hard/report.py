"""The table of hard cases, for terminals and for docs/hard_cases.md."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ldcs_ros.study.hard.case import AUDIT_SHARE, PROMISE
from ldcs_ros.study.hard.catalogue import CHAPTERS
from ldcs_ros.study.hard.runner import Row

COLUMNS = (
    "case",
    "asked accuracy [m]",
    "outcome",
    "worst error [m]",
    "energy audit",
    "steps",
    "rejected",
    "x real time",
)


def cells(row: Row) -> tuple[str, ...]:
    """Return a row's cells in the order of `COLUMNS`."""
    solver = row.case.scene.get("solver", {})
    asked = f"{row.case.accuracy:.0e}" if row.case.accuracy is not None else f"dt = {solver['dt']:g} s"
    return (
        row.case.name,
        asked,
        row.outcome,
        _number(row.error, ".1e"),
        _number(row.audit, ".1e"),
        str(row.steps),
        str(row.rejected_steps),
        _number(row.pace, ".3g"),
    )


def as_text(row: Row) -> str:
    """Return one line for a terminal."""
    name, *rest = cells(row)
    line = f"{name:<58} " + " ".join(
        f"{cell:>{width}}" for cell, width in zip(rest, (10, 8, 8, 8, 7, 6, 8), strict=True)
    )
    return f"{line}  {row.note}".rstrip()


def summary(rows: Sequence[Row]) -> str:
    """Return one sentence with the counts."""
    count = {
        outcome: sum(row.outcome == outcome for row in rows) for outcome in ("right", "refused", "wrong")
    }
    exact = [row for row in rows if row.case.accuracy is not None and math.isfinite(row.error)]
    within = sum(row.error <= (row.case.accuracy or 0.0) for row in exact)
    return (
        f"{len(rows)} cases: {count['right']} right, {count['refused']} stopped with a reason, {count['wrong']} wrong; "
        f"{within} of {len(exact)} compared ones within the asked accuracy itself."
    )


def as_markdown(rows: Sequence[Row], *, machine: dict[str, str], command: str) -> str:
    """Return the whole page."""
    by_name = {row.case.name: row for row in rows}
    lines = [
        "# Hard cases",
        "",
        f"Written by `{command}`. {summary(rows)}",
        "",
        "Each case is a scene as data in `ldcs_ros/study/hard/`, with what counts as right. *Worst error*: the largest "
        "distance of any node at any of 40 times from the same scene at a hundredth of the asked accuracy, or from the "
        "rest state that the static solver finds, or between cycles, or the motion of a sheet that should lie still. "
        f"It may be {PROMISE:g} times the asked accuracy: what an asked accuracy promises is that error nearly always, "
        "and never more than that. *Energy audit*: the largest residual of kinetic + elastic + gravity + dissipated "
        "energy - work of inputs and drives, as a share of the energy moved; "
        f"it may be {AUDIT_SHARE:g} times the asked accuracy over the sheet's length. "
        "*Rejected* steps were taken again, shorter. Times are from one run on a shared machine: "
        + ", ".join(f"{name} {value}" for name, value in machine.items())
        + ".",
    ]
    for chapter, cases in CHAPTERS.items():
        shown = [by_name[case.name] for case in cases if case.name in by_name]
        if not shown:
            continue
        lines += ["", f"## {chapter}", "", "| " + " | ".join(COLUMNS) + " |", "|---|---|---|" + "---:|" * 5]
        lines += ["| " + " | ".join(cells(row)) + " |" for row in shown]
        remarks: dict[str, list[str]] = {}
        for row in shown:
            for remark in (row.case.reason, row.note):
                if remark:
                    remarks.setdefault(remark, []).append(row.case.name)
        lines += [""] if remarks else []
        lines += [f"- {'; '.join(names)}: {remark}." for remark, names in remarks.items()]
    return "\n".join(lines) + "\n"


def _number(value: float, style: str) -> str:
    return format(value, style) if math.isfinite(value) else "-"

"""Results of hard cases in a CSV file: a row is on disk when its case ends, so an interrupted run continues."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from ldcs_ros.study.hard.catalogue import CASES
from ldcs_ros.study.hard.runner import CaseResult

FILE = "hard_cases.csv"
COLUMNS = tuple(field.name for field in fields(CaseResult))


def read_results(folder: Path) -> list[CaseResult]:
    """Return the results that a folder holds, those of cases that the catalogue still has."""
    path = folder / FILE
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row["case"] in CASES and None not in row.values()]
    return [
        CaseResult(
            CASES[row["case"]],
            row["outcome"],
            float(row["error"]),
            row["reference"],
            float(row["audit"]),
            int(row["steps"]),
            int(row["rejected_steps"]),
            float(row["pace"]),
            row["note"],
        )
        for row in rows
    ]


def write_results(results: Sequence[CaseResult], folder: Path) -> None:
    """Write results into a folder; the file is whole at any time."""
    folder.mkdir(parents=True, exist_ok=True)
    beside = folder / f"{FILE}.new"
    with beside.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for result in results:
            values = [getattr(result, name) for name in COLUMNS]
            writer.writerow(
                [result.case.name, *(f"{v:.6g}" if isinstance(v, float) else v for v in values[1:])]
            )
    beside.replace(folder / FILE)

"""Results of hard cases in a CSV file: a row is on disk when its case ends, so an interrupted run continues."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from ldcs_ros.study.hard.catalogue import CASES
from ldcs_ros.study.hard.runner import CaseResult

FILE = "hard_cases.csv"
_FIELDS = fields(CaseResult)[1:]
COLUMNS = ("case", "scene", *(field.name for field in _FIELDS))
_READERS = {"str": str, "float": float, "int": int}


def read_results(folder: Path) -> list[CaseResult]:
    """Return the results that a folder holds, those of cases that the catalogue still has, unchanged."""
    path = folder / FILE
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [
            row for row in csv.DictReader(stream) if set(row) == set(COLUMNS) and None not in row.values()
        ]
    return [
        CaseResult(
            CASES[row["case"]],
            **{field.name: _READERS[str(field.type)](row[field.name]) for field in _FIELDS},
        )
        for row in rows
        if row["case"] in CASES and CASES[row["case"]].key == row["scene"]
    ]


def write_results(results: Sequence[CaseResult], folder: Path) -> None:
    """Write results into a folder; the file is whole at any time."""
    folder.mkdir(parents=True, exist_ok=True)
    beside = folder / f"{FILE}.new"
    with beside.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for result in results:
            values = [getattr(result, field.name) for field in _FIELDS]
            shown = (f"{value:.6g}" if isinstance(value, float) else value for value in values)
            writer.writerow([result.case.name, result.case.key, *shown])
    beside.replace(folder / FILE)

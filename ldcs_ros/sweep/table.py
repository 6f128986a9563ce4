"""The table of a sweep: rows are on disk as they come, so an interrupted sweep continues."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ldcs_ros.sweep.design import SweepError
from ldcs_ros.sweep.evaluate import SampleResult

INDEX, STABLE, FAILURE = "sample", "stable", "failure"


class SweepTable:
    """Rows in a CSV file, beside a JSON file that says which sweep they are of.

    Args:
        path: The CSV file; made if it does not exist.
        about: The sweep as plain data; a table that is there must be of the same one.
        factors: Names of the factors.
        measures: Names of the measures.

    Raises:
        SweepError: The file is there but is no table of this sweep.
    """

    def __init__(
        self, path: Path, about: dict[str, object], factors: Sequence[str], measures: Sequence[str]
    ) -> None:
        self.path = path
        self._factors, self._measures = len(factors), len(measures)
        self._columns = (INDEX, *factors, *measures, STABLE, FAILURE)
        self.rows: dict[int, SampleResult] = {}
        beside = path.with_suffix(".json")
        text = json.dumps(about, indent=1, sort_keys=True)
        if path.exists():
            if not beside.exists() or beside.read_text(encoding="utf-8") != text:
                raise SweepError(
                    f"{path} is there and of another sweep (scene, factors, measures, samples or seed); "
                    "name another file, or remove it"
                )
            self._read()
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(text, encoding="utf-8")
        with path.open("x", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerow(self._columns)

    def add(self, rows: Sequence[SampleResult]) -> None:
        """Append rows that are not in it yet; they are on disk when this returns."""
        new = [row for row in rows if row.index not in self.rows]
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(map(_cells, new))
            file.flush()
            os.fsync(file.fileno())
        self.rows |= {row.index: row for row in new}

    def measured(self, size: int) -> np.ndarray:
        """Return the measures of all samples, shape (size, n_measures); NaN where there are none."""
        found = np.full((size, self._measures), np.nan)
        for index, row in self.rows.items():
            found[index] = row.measured
        return found

    def _read(self) -> None:
        text = self.path.read_text(encoding="utf-8")
        # A power cut can leave half a line at the end; its sample is evaluated again.
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            os.truncate(self.path, len(whole.encode()))
        lines = list(csv.reader(whole.splitlines()))
        if not lines or tuple(lines[0]) != self._columns:
            raise SweepError(f"{self.path} has the columns {lines[:1]}, expected {list(self._columns)}")
        try:
            for line in lines[1:]:
                row = self._row(line)
                self.rows[row.index] = row
        except (ValueError, IndexError) as error:
            raise SweepError(f"{self.path} has an invalid row ({error}); remove the row") from error

    def _row(self, cells: list[str]) -> SampleResult:
        end = 1 + self._factors
        numbers = [float(cell) if cell else math.nan for cell in cells[1 : end + self._measures]]
        stable = {"": None, "yes": True, "no": False}[cells[-2]]
        return SampleResult(
            int(cells[0]), tuple(numbers[: end - 1]), tuple(numbers[end - 1 :]), stable, cells[-1]
        )


def _cells(row: SampleResult) -> list[str]:
    numbers = ["" if math.isnan(value) else repr(value) for value in (*row.values, *row.measured)]
    stable = "" if row.stable is None else "yes" if row.stable else "no"
    return [str(row.index), *numbers, stable, row.failure]

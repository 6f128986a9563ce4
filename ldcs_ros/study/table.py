"""The study's CSV: rows are added as they come, so that an interrupted study goes on where it stopped."""

from __future__ import annotations

import csv
import os
from dataclasses import asdict
from pathlib import Path

from ldcs_ros.errors import LdcsError
from ldcs_ros.study.tasks import COLUMNS, Row

NUMBERS = {"nodes": int, "value": float, "error": float, "cpu": float}
COUNTS = ("steps", "rejected", "evaluations", "factorisations")


class StudyError(LdcsError, ValueError):
    """A study cannot be made or continued as asked."""


class Table:
    """Rows in a file; reading one back gives what was written.

    Args:
        path: The CSV file; made if it does not exist.

    Raises:
        StudyError: The file is there but is no table of a study.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: list[Row] = self._read() if path.exists() else []
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerow(COLUMNS)

    def add(self, rows: list[Row]) -> None:
        """Append rows; they are on disk when this returns."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            for row in rows:
                writer.writerow({name: _text(value) for name, value in asdict(row).items()})
            file.flush()
            os.fsync(file.fileno())
        self.rows += rows

    def keep(self, rows: list[Row]) -> None:
        """Leave only these of the rows; the file is whole at any time."""
        beside = self.path.with_suffix(".csv.new")
        beside.unlink(missing_ok=True)
        Table(beside).add(rows)
        os.replace(beside, self.path)
        self.rows = list(rows)

    def _read(self) -> list[Row]:
        text = self.path.read_text(encoding="utf-8")
        reader = csv.DictReader(text.splitlines())
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise StudyError(
                f"{self.path} is no table of this study: its columns are {reader.fieldnames}, "
                f"expected {list(COLUMNS)}; choose another folder"
            )
        # A last line that a power cut left half is taken away and measured again.
        if not text.endswith("\n"):
            os.truncate(self.path, len(text[: text.rfind("\n") + 1].encode()))
            reader = csv.DictReader(text[: text.rfind("\n")].splitlines())
        try:
            return [_row(line) for line in reader]
        except (TypeError, ValueError) as error:
            raise StudyError(
                f"{self.path} has a row that cannot be read ({error}); remove it, or choose another folder"
            ) from error


def _row(line: dict[str, str]) -> Row:
    values: dict[str, object] = {**line, **{name: kind(line[name]) for name, kind in NUMBERS.items()}}
    return Row(**{**values, **{name: int(line[name]) for name in COUNTS}})  # type: ignore[arg-type]


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)

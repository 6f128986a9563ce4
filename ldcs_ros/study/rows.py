"""Tasks and rows of a study, and its CSV: rows are on disk as they come, so an interrupted study continues."""

from __future__ import annotations

import csv
import os
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.simulation.statistics import Statistics

BASELINE, SCIPY = "compiled_rkc2", ("scipy_BDF", "scipy_Radau")
METHODS_APART = (BASELINE, *SCIPY)
MANY_ROWS = ("accuracy", "effect", "rate", "learning")
Key = tuple[str, str, int, str, str, str]


class StudyError(LdcsError, ValueError):
    """An invalid study, or one that cannot be continued."""


@dataclass(frozen=True)
class Row:
    """A line of the CSV.

    Attributes:
        kind: 'curve' (a point of a work-precision diagram), 'accuracy' (asked against real accuracy), 'effect' (cost
            of an effect), 'spatial' (error of the lattice itself), 'scaling' (cost and memory by lattice size), 'rate'
            (commands at a rate), 'verified' (cost of a verified run), 'learning' (steps of environments), 'paired'
            (a run in turns with another checkout), 'check' (the reference against another solver).
        scene: Problem by name.
        nodes: Nodes along a side.
        method: Integrator, or a solver of another origin.
        setting: 'accuracy', 'dt' or 'rate'; for an effect, the one that is left out; for a pair, its kind of commands.
        value: The setting's value [m, s or Hz].
        error: Largest node position error at the comparison times [m].
        cpu: CPU seconds per simulated second, one thread.
        steps: Accepted steps.
        rejected: Rejected steps.
        evaluations: Force evaluations.
        factorisations: Matrices factored.
        extra: Values of this kind alone, as text.
        failure: Reason for a missing error; '' if there is one.
    """

    kind: str
    scene: str
    nodes: int
    method: str
    setting: str
    value: float
    error: float = float("nan")
    cpu: float = float("nan")
    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorisations: int = 0
    extra: str = ""
    failure: str = ""

    @property
    def key(self) -> Key:
        """Key of the task that the row came from."""
        return self.kind, self.scene, self.nodes, self.method, self.setting, f"{self.value:.6g}"

    def compared(self, positions: np.ndarray, known: np.ndarray, cpu: float, duration: float) -> Row:
        """Return the row with the error of positions and the CPU time of a duration [s].

        Args:
            positions: Node positions [m], shape (n_times, n_nodes, 3).
            known: The reference's, of the same shape.
            cpu: CPU time of the whole duration [s].
            duration: Simulated time [s].
        """
        # Nodes in holes have no place.
        gap = np.abs(positions - known)[~np.isnan(known)]
        return replace(self, error=float(gap.max()), cpu=cpu / duration)

    def counted(self, spent: Statistics) -> Row:
        """Return the row with the counts of a run."""
        return replace(
            self,
            steps=spent.steps,
            rejected=spent.rejected_steps,
            evaluations=spent.evaluations,
            factorisations=spent.factorisations,
        )


COLUMNS = tuple(field.name for field in fields(Row))
_NUMBERS = {"nodes": int, "value": float, "error": float, "cpu": float}
_COUNTS = ("steps", "rejected", "evaluations", "factorisations")


@dataclass(frozen=True)
class Task:
    """A measurement to make; see Row for the names.

    Attributes:
        runs: Most runs; the best CPU time counts.
        budget: CPU time that one run may take, judged by the pace of its first steps [s].
        weight: Rough duration for the progress bar [s].
        checkout: Folder of the other checkout of a pair.
    """

    kind: str
    scene: str
    nodes: int
    method: str
    setting: str
    value: float
    runs: int = 3
    budget: float = 30.0
    weight: float = 1.0
    checkout: str = ""

    def row(self) -> Row:
        """Return the task's row without results."""
        return Row(self.kind, self.scene, self.nodes, self.method, self.setting, self.value)

    @property
    def key(self) -> Key:
        """Two tasks of one key are the same measurement."""
        return self.row().key

    @property
    def problem(self) -> tuple[str, int] | None:
        """Scene and nodes of the reference solution that the task needs, if any."""
        return (self.scene, self.nodes) if self.kind in ("curve", "check") else None


class Table:
    """Rows in a file; reading the file gives the rows that were written.

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

    def missing(self, tasks: list[Task]) -> list[Task]:
        """Return the tasks without a row."""
        have = {_measurement(row) for row in self.rows}
        return [task for task in tasks if _measurement(task) not in have]

    def add(self, rows: list[Row]) -> None:
        """Append rows; they are on disk when this returns."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            for row in rows:
                writer.writerow({name: _text(value) for name, value in asdict(row).items()})
            file.flush()
            os.fsync(file.fileno())
        self.rows += rows

    def remove(self, tasks: list[Task]) -> None:
        """Remove the rows of tasks; the file is whole at any time."""
        removed = {_measurement(task) for task in tasks}
        rows = [row for row in self.rows if _measurement(row) not in removed]
        beside = self.path.with_suffix(".csv.new")
        beside.unlink(missing_ok=True)
        Table(beside).add(rows)
        os.replace(beside, self.path)
        self.rows = rows

    def _read(self) -> list[Row]:
        text = self.path.read_text(encoding="utf-8")
        reader = csv.DictReader(text.splitlines())
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise StudyError(
                f"{self.path} is no table of this study: its columns are {reader.fieldnames}, "
                f"expected {list(COLUMNS)}; choose another folder"
            )
        # A power cut can leave half a line at the end; it is removed and measured again.
        if not text.endswith("\n"):
            os.truncate(self.path, len(text[: text.rfind("\n") + 1].encode()))
            reader = csv.DictReader(text[: text.rfind("\n")].splitlines())
        try:
            return [_row(line) for line in reader]
        except (TypeError, ValueError) as error:
            raise StudyError(
                f"{self.path} has an invalid row ({error}); remove the row, or choose another folder"
            ) from error


def _measurement(measured: Task | Row) -> Key | tuple[str, str, str]:
    # The rows of an accuracy check or of an effect have settings of their own: kind and scene identify their task.
    if measured.kind not in MANY_ROWS:
        return measured.key
    return measured.kind, measured.scene, f"{measured.value:.6g}" if measured.kind == "rate" else ""


def _row(line: dict[str, str]) -> Row:
    values: dict[str, object] = {**line, **{name: kind(line[name]) for name, kind in _NUMBERS.items()}}
    return Row(**{**values, **{name: int(line[name]) for name in _COUNTS}})  # type: ignore[arg-type]


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)

"""What `ldcs study --hard` does: runs the catalogue, prints each row as it comes, writes hard_cases.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from ldcs_ros.study.hard.case import HardCase
from ldcs_ros.study.hard.catalogue import CASES
from ldcs_ros.study.hard.report import as_markdown
from ldcs_ros.study.hard.runner import Row, run_case


def run_catalogue(
    cases: Sequence[HardCase] = tuple(CASES.values()),
    *,
    jobs: int = 1,
    on_row: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Run cases and return their rows in order.

    Args:
        cases: What to run.
        jobs: Processes; with more than one, times are noisier.
        on_row: Called with each row as it comes.
    """
    rows = []
    for row in _rows(cases, jobs):
        on_row(row)
        rows.append(row)
    return rows


def write_page(rows: Sequence[Row], folder: Path, *, machine: dict[str, str], command: str) -> Path:
    """Write hard_cases.md into a folder and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "hard_cases.md"
    path.write_text(as_markdown(rows, machine=machine, command=command), encoding="utf-8")
    return path


def _rows(cases: Sequence[HardCase], jobs: int) -> Iterator[Row]:
    if jobs == 1:
        yield from map(run_case, cases)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(run_case, cases)

"""Runs tasks: here one after another, in processes, or on a Dask cluster; rows come back as they are made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from ldcs_ros.study.table import StudyError, Table
from ldcs_ros.study.tasks import Task, key_of, perform, reference

# A call to carry out: (what to call, its arguments) -> iterator of (index, result) as they end.
Submit = Callable[[Callable[..., Any], list[tuple[Any, ...]]], Iterator[tuple[int, Any]]]


def in_this_process(
    function: Callable[..., Any], arguments: list[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Call one after another: times are side by side, nothing else competes."""
    for index, given in enumerate(arguments):
        yield index, function(*given)


@contextmanager
def processes(count: int) -> Iterator[Submit]:
    """Give a way to call in `count` processes of this machine; fewer seconds, noisier times."""
    import multiprocessing

    # spawn: BLAS threads and numba's locks do not survive a fork.
    with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn")) as pool:

        def submit(
            function: Callable[..., Any], arguments: list[tuple[Any, ...]]
        ) -> Iterator[tuple[int, Any]]:
            pending = {pool.submit(function, *given): index for index, given in enumerate(arguments)}
            for future in as_completed(pending):
                yield pending[future], future.result()

        try:
            yield submit
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


@contextmanager
def cluster(address: str) -> Iterator[Submit]:
    """Give a way to call on a Dask cluster; 'local' makes one on this machine.

    Raises:
        StudyError: dask.distributed is not installed, or nothing answers at the address.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise StudyError(
            "--scheduler needs dask.distributed; install it with: pip install 'ldcs_ros[cluster]'"
        ) from error
    try:
        client = (
            distributed.Client(processes=True, threads_per_worker=1, dashboard_address=None)
            if address == "local"
            else distributed.Client(address, timeout="10s")
        )
    except (OSError, ValueError) as error:
        raise StudyError(
            f"no Dask scheduler answers at '{address}': {error}; start one with `dask scheduler`, or use "
            f"--scheduler local"
        ) from error
    with client:

        def submit(
            function: Callable[..., Any], arguments: list[tuple[Any, ...]]
        ) -> Iterator[tuple[int, Any]]:
            pending = {
                client.submit(function, *given, pure=False): index for index, given in enumerate(arguments)
            }
            for future in distributed.as_completed(pending):
                yield pending[future], future.result()

        yield submit


def carry_out(tasks: list[Task], table: Table, submit: Submit, *, on_done: Callable[[int], None]) -> None:
    """Carry out the tasks that the table has no row of yet; rows are on disk as soon as they are made.

    Args:
        tasks: What to measure.
        table: Where rows go.
        submit: How calls are made.
        on_done: Called with the number of tasks and references done so far.
    """
    have = {key_of(row) for row in table.rows}
    groups = {(row.kind, row.scene) for row in table.rows}
    left = [task for task in tasks if not _is_done(task, have, groups)]
    problems = sorted({task.problem for task in left if task.problem is not None})
    done = len(tasks) - len(left)
    on_done(done)
    known: dict[tuple[str, int], np.ndarray] = {}
    for index, course in submit(reference, list(problems)):
        known[problems[index]] = course
    calls = [(task, known.get(task.problem) if task.problem else None) for task in left]
    for _, rows in submit(perform, calls):
        table.add(rows)
        done += 1
        on_done(done)


def _is_done(task: Task, have: set[Any], groups: set[tuple[str, str]]) -> bool:
    # A promise or effect task gives many rows with other settings than its own.
    if task.kind in ("promise", "effect"):
        return (task.kind, task.scene) in groups
    return task.key in have

"""Runs tasks: here one after another, in processes, or on a Dask cluster; rows come back as they are made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from ldcs_ros.study.table import StudyError, Table
from ldcs_ros.study.tasks import Row, Task, key_of, perform, reference

# A call to carry out: (what to call, its arguments) -> iterator of (index, result) as they end.
Submit = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[tuple[int, Any]]]
# Kinds of tasks that give several rows each.
MANY_ROWS = ("promise", "effect", "rate")


def in_this_process(
    function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
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
            function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
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
            function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]
        ) -> Iterator[tuple[int, Any]]:
            pending = {
                client.submit(function, *given, pure=False): index for index, given in enumerate(arguments)
            }
            for future in distributed.as_completed(pending):
                yield pending[future], future.result()

        yield submit


def carry_out(
    tasks: list[Task],
    table: Table,
    submit: Submit,
    *,
    on_done: Callable[[float], None],
    on_begin: Callable[[str], None] | None = None,
) -> None:
    """Carry out the tasks that the table has no row of yet; rows are on disk as soon as they are made.

    Args:
        tasks: What to measure.
        table: Where rows go.
        submit: How calls are made.
        on_done: Called with the sum of the weights of the tasks done so far.
        on_begin: Called with a few words when a task of this process begins.
    """
    have = {key_of(row) for row in table.rows}
    groups = {_group(row) for row in table.rows}
    left = [
        task for task in tasks if not (_group(task) in groups if task.kind in MANY_ROWS else task.key in have)
    ]
    done = sum(task.weight for task in tasks) - sum(task.weight for task in left)
    on_done(done)
    if submit is in_this_process:
        # A problem's tasks one after the other: what an interruption loses is one reference at most.
        first: dict[object, int] = {}
        for place, task in enumerate(left):
            first.setdefault(task.problem or task.key, place)
        left.sort(key=lambda task: first[task.problem or task.key])
    else:
        # The long ones first: nobody waits for one process at the end.
        left.sort(key=lambda task: -task.weight)
    for index, rows in submit(perform, _calls(left, submit, on_begin or (lambda words: None))):
        table.add(rows)
        done += left[index].weight
        on_done(done)


def _calls(
    left: list[Task], submit: Submit, on_begin: Callable[[str], None]
) -> Iterator[tuple[Task, np.ndarray | None]]:
    """Give each task with its reference, which is made here when it is needed, or elsewhere before all of them."""
    known: dict[tuple[str, int], np.ndarray] = {}
    if submit is not in_this_process:
        wanted = {task.problem for task in left if task.problem is not None}
        problems = sorted(wanted, key=lambda problem: -problem[1])
        for index, course in submit(reference, list(problems)):
            known[problems[index]] = course
    for task in left:
        if task.problem is not None and task.problem not in known:
            on_begin(f"reference of {task.scene} {task.nodes} x {task.nodes}")
            known[task.problem] = reference(*task.problem)
        on_begin(f"{task.method} on {task.scene} {task.nodes} x {task.nodes}" if task.nodes else task.scene)
        yield task, known[task.problem] if task.problem is not None else None


def _group(measured: Task | Row) -> tuple[str, str, str]:
    # A task of many rows is known by what it asks; the settings of a promise or an effect are its rows' own.
    value = f"{measured.value:.6g}" if measured.kind == "rate" else ""
    return measured.kind, measured.scene, value

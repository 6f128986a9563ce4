"""Runs tasks: here one after another, in processes, or on a Dask cluster; rows come back as they are made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from ldcs_ros.study.table import StudyError, Table
from ldcs_ros.study.tasks import Row, Task, key_of, perform, reference

# A call to carry out: (what to call, its arguments) -> iterator of (index, result) as they end.
Submit = Callable[[Callable[..., Any], list[tuple[Any, ...]]], Iterator[tuple[int, Any]]]
# Kinds of tasks that give several rows each.
MANY_ROWS = ("promise", "effect", "rate")


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
        except BrokenProcessPool as error:
            raise StudyError(
                "a process of the study was ended from outside, or by a lack of memory; what it had made is kept: run "
                "the same command again to go on, with fewer --jobs if memory is short"
            ) from error
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
    say = on_begin or (lambda words: None)
    for task, rows in _one_by_one(left, say) if submit is in_this_process else _all_at_once(left, submit):
        table.add(rows)
        done += task.weight
        on_done(done)


def of_other_tasks(rows: list[Row], tasks: list[Task]) -> list[Row]:
    """Return the rows that none of the tasks makes."""
    keys, groups = {task.key for task in tasks}, {_group(task) for task in tasks}
    return [
        row for row in rows if not (_group(row) in groups if row.kind in MANY_ROWS else key_of(row) in keys)
    ]


def _one_by_one(left: list[Task], say: Callable[[str], None]) -> Iterator[tuple[Task, list[Row]]]:
    """Carry tasks out here, those of a problem one after the other: an interruption loses one reference at most."""
    first: dict[object, int] = {}
    for place, task in enumerate(left):
        first.setdefault(task.problem or task.key, place)
    known: dict[tuple[str, int], np.ndarray] = {}
    for task in sorted(left, key=lambda task: first[task.problem or task.key]):
        if task.problem is not None and task.problem not in known:
            say(f"reference of {task.scene} {task.nodes} x {task.nodes}")
            known[task.problem] = reference(*task.problem)
        say(f"{task.method} on {task.scene} {task.nodes} x {task.nodes}" if task.nodes else task.scene)
        yield task, perform(task, known[task.problem] if task.problem is not None else None)


def _all_at_once(left: list[Task], submit: Submit) -> Iterator[tuple[Task, list[Row]]]:
    """Carry tasks out elsewhere, long ones first: references and what needs none, then what needs a reference."""
    left = sorted(left, key=lambda task: -task.weight)
    wanted = {task.problem for task in left if task.problem is not None}
    problems = sorted(wanted, key=lambda problem: -problem[1])
    free = [task for task in left if task.problem is None]
    known: dict[tuple[str, int], np.ndarray] = {}
    calls = [(problem, None) for problem in problems] + [(None, task) for task in free]
    for index, result in submit(_reference_or_rows, calls):
        if index < len(problems):
            known[problems[index]] = result
        else:
            yield free[index - len(problems)], result
    bound = [task for task in left if task.problem is not None]
    for index, rows in submit(perform, [(task, known[task.problem]) for task in bound if task.problem]):
        yield bound[index], rows


def _reference_or_rows(problem: tuple[str, int] | None, task: Task | None) -> Any:
    return perform(task) if task is not None else reference(*problem) if problem is not None else None


def _group(measured: Task | Row) -> tuple[str, str, str]:
    # A task of many rows is known by what it asks; the settings of a promise or an effect are its rows' own.
    value = f"{measured.value:.6g}" if measured.kind == "rate" else ""
    return measured.kind, measured.scene, value

"""Runs tasks: here one after another, in processes, or on a Dask cluster; rows come back as they are made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from multiprocessing import get_context
from typing import Protocol, TypeVar

import numpy as np

from ldcs_ros import extras
from ldcs_ros.errors import one_line
from ldcs_ros.study.rows import Row, StudyError, Table, Task
from ldcs_ros.study.tasks import perform, reference

Result = TypeVar("Result")


class Submit(Protocol):
    """A way to make calls; it yields (index, result) in the order in which calls end."""

    def __call__(self, calls: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
        """Make the calls."""


def in_this_process(calls: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
    """Make one call after another: times are side by side, nothing else competes."""
    for index, call in enumerate(calls):
        yield index, call()


def call(function: Callable[[], Result]) -> Result:
    """Call a function; a process pool needs a function of this module."""
    return function()


@contextmanager
def processes(count: int) -> Iterator[Submit]:
    """Return a way to make calls in `count` processes of this machine; times are noisier."""
    # spawn: BLAS threads and numba's locks do not survive a fork.
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:

        def submit(calls: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
            pending = {pool.submit(call, one): index for index, one in enumerate(calls)}
            for future in as_completed(pending):
                yield pending[future], future.result()

        try:
            yield submit
        except BrokenProcessPool as error:
            raise StudyError(
                "a worker process was ended from outside, or by a lack of memory; finished rows are kept: run "
                "the same command again to continue, with fewer --jobs if memory is short"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


@contextmanager
def cluster(address: str) -> Iterator[Submit]:
    """Return a way to make calls on a Dask cluster; 'local' makes one on this machine.

    Raises:
        MissingPackageError: dask.distributed is not installed.
        StudyError: No scheduler answers at the address, or workers died.
    """
    distributed = extras.load("distributed", extra="cluster", purpose="--scheduler")
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

        def submit(calls: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
            pending = {client.submit(call, one, pure=False): index for index, one in enumerate(calls)}
            for future in distributed.as_completed(pending):
                try:
                    result = future.result()
                except (
                    distributed.KilledWorker,
                    distributed.CancelledError,
                    distributed.comm.CommClosedError,
                ) as error:
                    raise StudyError(
                        f"the cluster lost a call ({one_line(error)[:200]}); finished rows are kept: run the same "
                        "command again to continue"
                    ) from error
                yield pending[future], result

        yield submit


def workers(jobs: int, scheduler: str | None) -> AbstractContextManager[Submit]:
    """Return the way to make calls that a command line asks for."""
    if scheduler is not None:
        return cluster(scheduler)
    return processes(jobs) if jobs > 1 else nullcontext(in_this_process)


def run_tasks(
    tasks: list[Task],
    table: Table,
    submit: Submit,
    *,
    on_done: Callable[[float], None],
    on_begin: Callable[[str], None] = lambda words: None,
) -> None:
    """Perform the tasks that have no row in the table; rows are on disk as soon as they are made.

    Args:
        tasks: The measurements.
        table: The table of all rows.
        submit: The way to make calls.
        on_done: Called with the sum of the weights of finished tasks.
        on_begin: Called with a few words when a task of this process begins.
    """
    left = table.missing(tasks)
    done = sum(task.weight for task in tasks) - sum(task.weight for task in left)
    on_done(done)
    performed = _one_by_one(left, on_begin) if submit is in_this_process else _at_once(left, submit)
    for task, rows in performed:
        table.add(rows)
        done += task.weight
        on_done(done)


def _one_by_one(left: list[Task], on_begin: Callable[[str], None]) -> Iterator[tuple[Task, list[Row]]]:
    """Perform tasks here, those of a problem in a row: an interruption loses one reference at most."""
    first: dict[object, int] = {}
    for place, task in enumerate(left):
        first.setdefault(task.problem or task.key, place)
    known: dict[tuple[str, int], np.ndarray] = {}
    for task in sorted(left, key=lambda task: first[task.problem or task.key]):
        if task.problem is not None and task.problem not in known:
            on_begin(f"reference of {task.scene} {task.nodes} x {task.nodes}")
            known[task.problem] = reference(*task.problem)
        on_begin(f"{task.method} on {task.scene} {task.nodes} x {task.nodes}" if task.nodes else task.scene)
        yield task, perform(task, known[task.problem] if task.problem is not None else None)


def _at_once(left: list[Task], submit: Submit) -> Iterator[tuple[Task, list[Row]]]:
    """Perform tasks elsewhere, long ones first: references and tasks without one, then tasks that need one."""
    left = sorted(left, key=lambda task: -task.weight)
    problems = sorted({task.problem for task in left if task.problem is not None}, key=lambda p: -p[1])
    free = [task for task in left if task.problem is None]
    calls: list[Callable[[], np.ndarray | list[Row]]] = [
        *(partial(reference, *problem) for problem in problems),
        *(partial(perform, task) for task in free),
    ]
    known: dict[tuple[str, int], np.ndarray] = {}
    for index, result in submit(calls):
        if isinstance(result, np.ndarray):
            known[problems[index]] = result
        else:
            yield free[index - len(problems)], result
    bound = [(task, task.problem) for task in left if task.problem is not None]
    for index, rows in submit([partial(perform, task, known[problem]) for task, problem in bound]):
        yield bound[index][0], rows

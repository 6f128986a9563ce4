"""Worker processes that compute residuals of many parameter values and bags at once."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

import numpy as np

from ldcs_ros.identify.experiments import Experiment, IdentificationError
from ldcs_ros.identify.prediction import FIT_ACCURACY, linearised, residuals
from ldcs_ros.simulation.threads import core_count

Answer = TypeVar("Answer")

_shared: tuple[dict[str, Any], Sequence[Experiment]] | None = None


class Workers:
    """A pool of processes that compute residuals; a `with` block ends them.

    Args:
        content: The scene that is fitted.
        experiments: The bags.
        processes: Number of processes; 1 computes in this process, None takes one a core.

    Attributes:
        count: Parameter sets computed so far.
    """

    def __init__(
        self, content: dict[str, Any], experiments: Sequence[Experiment], *, processes: int | None = None
    ) -> None:
        self._content, self._experiments = content, experiments
        self.count = 0
        count = processes or core_count()
        self._pool: ProcessPoolExecutor | None = None
        if count > 1:
            # Spawned, not forked: the caller may have threads. Numba's kernels come from its cache on disk.
            self._pool = ProcessPoolExecutor(
                count,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_begin,
                initargs=(content, tuple(experiments)),
            )

    def residuals(
        self, candidates: Sequence[dict[str, float]], *, accuracy: float = FIT_ACCURACY
    ) -> list[np.ndarray | None]:
        """Return for each candidate the residuals of all bags, shape (n_residuals,); None if a bag has no answer.

        Raises:
            IdentificationError: A worker process ended.
        """
        self.count += len(candidates)
        size = len(self._experiments)
        parts = self._map(
            residuals, [(values, number, accuracy) for values in candidates for number in range(size)]
        )
        rows = [parts[size * k : size * (k + 1)] for k in range(len(candidates))]
        return [None if any(p is None for p in row) else np.concatenate(row) for row in rows]  # type: ignore[arg-type]

    def linearised(
        self, values: dict[str, float], *, accuracy: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the residuals of all bags and their derivatives by the values, shape (n, n_values), by tangents.

        Raises:
            IdentificationError: A worker process ended.
            ValueError: A run has no tangents by one of the numbers.
        """
        self.count += 1
        parts = self._map(
            linearised, [(values, number, accuracy) for number in range(len(self._experiments))]
        )
        found = [part for part in parts if part is not None]
        if len(found) < len(parts):
            return None
        return np.concatenate([gap for gap, _ in found]), np.concatenate([slope for _, slope in found])

    def _map(
        self, what: Callable[..., Answer], jobs: Sequence[tuple[dict[str, float], int, float]]
    ) -> list[Answer]:
        if self._pool is None:
            return [
                what(self._content, values, self._experiments[k], number=k, accuracy=a)
                for values, k, a in jobs
            ]
        try:
            return list(self._pool.map(_compute, [what] * len(jobs), jobs))
        except BrokenProcessPool as error:
            raise IdentificationError(
                "a worker process ended (out of memory, or a script without `if __name__ == '__main__':`); "
                "use one process"
            ) from error

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)


def _begin(content: dict[str, Any], experiments: Sequence[Experiment]) -> None:
    global _shared
    # Ctrl-C reaches the whole group: the caller ends the workers, which print no errors of their own.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _shared = (content, experiments)


def _compute(what: Callable[..., Answer], job: tuple[dict[str, float], int, float]) -> Answer:
    if _shared is None:
        raise RuntimeError("a worker process has no work")
    values, number, accuracy = job
    return what(_shared[0], values, _shared[1][number], number=number, accuracy=accuracy)

"""One BLAS thread while the simulation works: its matrices are small, and one thread gives the same bits every time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Protocol

from threadpoolctl import ThreadpoolController


class BlasLibrary(Protocol):
    """The part of a controller of threadpoolctl that is used; the package has no types."""

    def get_num_threads(self) -> int:
        """Return the number of threads."""

    def set_num_threads(self, num_threads: int) -> object:
        """Set the number of threads."""


def core_count() -> int:
    """Return the number of cores that this process may use, at least 1."""
    # macOS and Windows bind no process to cores, and have no such call.
    affinity = getattr(os, "sched_getaffinity", None)
    return (os.cpu_count() or 1) if affinity is None else len(affinity(0))


@cache
def _libraries() -> tuple[BlasLibrary, ...]:
    # The controller finds the libraries that are loaded: SciPy brings a BLAS of its own beside NumPy's.
    import scipy.linalg  # noqa: F401

    return tuple(ThreadpoolController().select(user_api="blas").lib_controllers)


_LOCK = Lock()
_inside = 0
_several: list[tuple[BlasLibrary, int]] = []


@contextmanager
def one_thread() -> Iterator[None]:
    """Return a context in which BLAS uses one thread; the last of several threads to leave it restores the number.

    On a busy machine two threads wait for each other: the factors of a 9 x 9 lattice take up to ten times longer.
    Their sums also round differently, so that a bag of a twin in a thread would not replay to the same bytes.
    """
    global _inside, _several
    with _LOCK:
        if _inside == 0:
            before = [(library, library.get_num_threads()) for library in _libraries()]
            _several = [(library, count) for library, count in before if count != 1]
            for library, _ in _several:
                _set(library, 1)
        _inside += 1
    try:
        yield
    finally:
        with _LOCK:
            _inside -= 1
            if _inside == 0:
                for library, count in _several:
                    _set(library, count)


def _set(library: BlasLibrary, count: int) -> None:
    # threadpoolctl 3.8 lets one thread set numbers, the first that did; a call of another one has no effect.
    release = getattr(library, "clear_controlling_thread", None)
    if release is not None:
        release(force=True)
    library.set_num_threads(count)

"""One BLAS thread while the simulation works: its matrices are small, and one thread gives the same bits every time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


@cache
def _libraries() -> tuple[Any, ...]:
    # Any: threadpoolctl has no types.
    # The controller finds the libraries that are loaded: SciPy brings a BLAS of its own beside NumPy's.
    import scipy.linalg  # noqa: F401

    return tuple(ThreadpoolController().select(user_api="blas").lib_controllers)


@contextmanager
def one_thread() -> Iterator[None]:
    """Return a context in which BLAS uses one thread.

    On a busy machine two threads wait for each other: the factors of a 9 x 9 lattice take up to ten times longer.
    Their sums may also round differently from run to run.
    """
    before = [(library, library.get_num_threads()) for library in _libraries()]
    several = [(library, count) for library, count in before if count != 1]
    for library, _ in several:
        library.set_num_threads(1)
    try:
        yield
    finally:
        for library, count in several:
            library.set_num_threads(count)

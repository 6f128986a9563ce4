"""One BLAS thread while the simulation works: its matrices are small, and one thread gives the same bits every time."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


@cache
def _controller() -> Any:
    # The controller finds the libraries that are loaded: SciPy brings a BLAS of its own beside NumPy's.
    import scipy.linalg  # noqa: F401

    return ThreadpoolController().select(user_api="blas")


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which BLAS uses one thread.

    Two threads on the factors of a 9 x 9 lattice cost up to ten times more on a busy machine than one (they
    wait for each other), and their sums may round differently from run to run.
    """
    limited: AbstractContextManager[Any] = _controller().limit(limits=1)
    return limited

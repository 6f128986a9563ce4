"""`compiled`: numba's njit with a cache on disk where numba is installed, the plain Python function where it is not."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    if os.environ.get("LDCS_NO_NUMBA"):
        raise ImportError("switched off by LDCS_NO_NUMBA")
    import numba

    HAVE_NUMBA = True
except ImportError:
    HAVE_NUMBA = False


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; without numba return it as it is (same answers, slower)."""
    if not HAVE_NUMBA:
        return function
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))

"""`compiled`: numba's njit with a cache on disk where numba is installed, the plain Python function where it is not."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> Path:
    # numba looks at the file of a kernel only, not at those of the kernels that it calls: an edit there would go
    # on running the old code. So each state of the sources has a cache of its own.
    package = Path(__file__).parents[1]
    sources = sorted(
        path for room in ("physics", "integrators", "study") for path in (package / room).rglob("*.py")
    )
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    beside = package / "__pycache__"
    writable = os.access(beside if beside.exists() else package, os.W_OK)
    home = beside if writable else Path(tempfile.gettempdir()) / f"ldcs_ros-{os.getuid()}"
    return home / f"kernels-{digest}"


try:
    if os.environ.get("LDCS_NO_NUMBA"):
        raise ImportError("switched off by LDCS_NO_NUMBA")
    import numba

    if not numba.config.CACHE_DIR:  # type: ignore[attr-defined]  # set at import
        numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]
    HAVE_NUMBA = True
except ImportError:
    HAVE_NUMBA = False


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; without numba return it as it is (same answers, slower)."""
    if not HAVE_NUMBA:
        return function
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))


def compiled_fast(function: Function) -> Function:
    """Compile with sums in any order, so that they run in vector registers; for results that are corrected later."""
    if not HAVE_NUMBA:
        return function
    return cast(
        Function, numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})(function)
    )

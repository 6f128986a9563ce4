"""`compiled`: numba's njit with a cache on disk where numba is installed, the plain Python function where it is not."""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> Path:
    # numba watches the file of a kernel only, not those of the kernels that it calls: the old code would run after
    # an edit there. So each state of the sources has a cache of its own.
    package = Path(__file__).parents[1]
    sources = sorted(
        path for room in ("physics", "integrators", "study") for path in (package / room).rglob("*.py")
    )
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return private_folder(f"kernels-{digest}", (package / "__pycache__", user / "ldcs_ros"))


def private_folder(name: str, parents: Iterable[Path]) -> Path:
    """Return a folder that no other user can write into; a cached kernel is a pickle, which runs code when loaded.

    Args:
        name: Name of the folder.
        parents: Candidates for its parent, in order of preference. A candidate counts only if this user owns it
            and no other user can write to it.

    Returns:
        The folder below the first sound parent; without one, a new folder that is removed when the process ends.
    """
    for parent in parents:
        folder = parent / name
        try:
            parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
            if _is_private(parent) and _is_private(folder) and os.access(folder, os.W_OK):
                return folder
        except (OSError, RuntimeError):
            continue
    temporary = tempfile.mkdtemp(prefix="ldcs_ros-")
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return Path(temporary)


def _is_private(folder: Path) -> bool:
    status = folder.lstat()  # a link could lead into the folder of another user
    if not hasattr(os, "getuid"):
        # Windows keeps others out by access lists, of which these bits say nothing.
        return stat.S_ISDIR(status.st_mode)
    return (
        stat.S_ISDIR(status.st_mode)
        and status.st_uid == os.getuid()
        and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


try:
    if os.environ.get("LDCS_NO_NUMBA"):
        raise ImportError("switched off by LDCS_NO_NUMBA")
    import numba

    if not numba.config.CACHE_DIR:  # type: ignore[attr-defined]  # set at import
        numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]
    HAVE_NUMBA = True
except ImportError:
    HAVE_NUMBA = False


def kernels_wait_for_compilation() -> bool:
    """Return whether the first call of a kernel compiles it: numba is there, its cache for these sources is empty."""
    if not HAVE_NUMBA:
        return False
    return next(Path(numba.config.CACHE_DIR).rglob("*.nbi"), None) is None  # type: ignore[attr-defined]


def compiled(function: Function) -> Function:
    """Compile a function of numbers and arrays; without numba return the function itself (same answers, slower)."""
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


def records(table: np.ndarray) -> np.ndarray:
    """Return a structured array of any shape whose fields kernels read as attributes, compiled or in plain Python."""
    compiles = HAVE_NUMBA and not numba.config.DISABLE_JIT  # type: ignore[attr-defined]  # set at import
    return table if compiles else table.view(np.recarray)

"""CPU time of one thread, and what machine and versions it was measured with."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ldcs_ros.simulation.threads import one_thread


def best_of(runs: int, work: Callable[[], Any], *, enough: float = 1.0) -> tuple[float, Any]:
    """Return the least CPU time of up to `runs` calls [s] and the last result; long ones are not repeated.

    Args:
        runs: How often to call at most.
        work: What to call.
        enough: CPU time [s] after which no further call is made.
    """
    best, spent, result = float("inf"), 0.0, None
    for _ in range(runs):
        began = time.thread_time()
        result = work()
        taken = time.thread_time() - began
        best, spent = min(best, taken), spent + taken
        if spent > enough:
            break
    return best, result


def in_turns(*works: Callable[[], Any], rounds: int) -> list[float]:
    """Return the least CPU time of each piece of work [s], calling them one after the other again and again.

    A busy machine then slows all of them alike: their ratios stand.
    """
    best = [float("inf")] * len(works)
    with one_thread():
        for _ in range(rounds):
            for index, work in enumerate(works):
                began = time.thread_time()
                work()
                best[index] = min(best[index], time.thread_time() - began)
    return best


def machine() -> dict[str, str]:
    """Return processor, system and the versions that decide speed."""
    import os

    import numpy
    import scipy

    from ldcs_ros import __version__
    from ldcs_ros.physics.compiled import HAVE_NUMBA

    numba = "absent"
    if HAVE_NUMBA:
        import numba as compiler

        numba = compiler.__version__
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "numba": numba,
        "ldcs_ros": __version__,
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"

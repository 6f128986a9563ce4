"""CPU time of one thread, and the machine and versions that it was measured with."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy
import scipy

from ldcs_ros import __version__
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.simulation.threads import one_thread

Result = TypeVar("Result")

ENOUGH = 1.0
"""CPU time [s] after which `best_of` makes no further call."""


def best_of(runs: int, work: Callable[[], Result]) -> tuple[float, Result]:
    """Return the least CPU time of up to `runs` calls [s] and the last result.

    Args:
        runs: Most calls; at least one is made.
        work: Function to call.
    """
    best, spent = float("inf"), 0.0
    while True:
        began = time.thread_time()
        result = work()
        taken = time.thread_time() - began
        best, spent, runs = min(best, taken), spent + taken, runs - 1
        if runs <= 0 or spent > ENOUGH:
            return best, result


def in_turns(*works: Callable[[], object], rounds: int, calls: int = 1) -> list[float]:
    """Return the least CPU time of a call of each piece of work [s], measured in turns.

    A busy machine then slows all of them alike, so their ratios hold.
    """
    best = [float("inf")] * len(works)
    with one_thread():
        for _ in range(rounds):
            for index, work in enumerate(works):
                began = time.thread_time()
                for _ in range(calls):
                    work()
                best[index] = min(best[index], (time.thread_time() - began) / calls)
    return best


def machine() -> dict[str, str]:
    """Return processor, system and the versions that decide speed."""
    compiler = "absent"
    if HAVE_NUMBA:
        import numba

        compiler = numba.__version__
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "numba": compiler,
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

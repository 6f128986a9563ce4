"""Cost and memory by lattice size: one size a process, so that the peak of its memory is its own."""

from __future__ import annotations

import gc
import json
import math
import statistics
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import ERROR_TIMES, scene_of
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.timing import best_of

MIB = 1024.0  # KiB


def scaling(task: Task) -> list[Row]:
    """Return the row of one lattice size, measured in a process of its own; `extra` has its peak memory [MiB].

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    command = [sys.executable, "-m", "ldcs_ros.study.scaling", json.dumps(asdict(task))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(
            f"the process for {task.nodes} x {task.nodes} nodes ended with {done.returncode}: {last}"
        )
    return [Row(**json.loads(done.stdout))]


def measure(task: Task) -> Row:
    """Return the cost of a whole run and the peak memory of this process."""
    scene = scene_of(task.scene, task.nodes, accuracy=task.value)
    # Loads and compiles; the kernels that factor depend on the size. The measured time includes the model's
    # construction, as in every other row.
    scene.build().advance_to(1e-4)
    gc.collect()

    def run() -> Simulation:
        simulation = scene.build()
        simulation.advance_to(ERROR_TIMES[-1])
        return simulation

    cpu, simulation = best_of(task.runs, run)
    row = task.row().counted(simulation.statistics)
    return replace(row, cpu=cpu / ERROR_TIMES[-1], extra=f"peak {_peak():.0f}")


def _peak() -> float:
    """Return the peak memory of this process [MiB]; NaN where the system does not say."""
    status = Path("/proc/self/status")
    if status.exists():
        # Of this program alone: the kernel's other figure begins with that of the process that started it.
        lines = status.read_text(encoding="utf-8").splitlines()
        return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / MIB
    try:
        import resource
    except ImportError:  # Windows
        return float("nan")
    # macOS counts bytes, others KiB.
    unit = 1024.0 * MIB if sys.platform == "darwin" else MIB
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def peak_memory(row: Row) -> float:
    """Return the peak memory of a scaling row's process [MiB]."""
    words = row.extra.split()
    return float(words[words.index("peak") + 1])


def measured_sizes(rows: Sequence[Row]) -> list[Row]:
    """Return the scaling rows that have a cost, the smallest lattice first."""
    made = [row for row in rows if row.kind == "scaling" and not row.failure]
    return sorted(made, key=lambda row: row.nodes)


def exponents(rows: Sequence[Row]) -> tuple[float, float]:
    """Return the powers of the number of nodes by which CPU time grows: least squares over all, and end to end."""
    made = measured_sizes(rows)
    if len(made) < 2:
        return math.nan, math.nan
    x = [math.log(float(row.nodes) ** 2) for row in made]
    y = [math.log(row.cpu) for row in made]
    return statistics.linear_regression(x, y).slope, (y[-1] - y[0]) / (x[-1] - x[0])


if __name__ == "__main__":
    print(json.dumps(asdict(measure(Task(**json.loads(sys.argv[1]))))))

"""How cost and memory grow with the lattice: one size a process, so that the peak of its memory is its own."""

from __future__ import annotations

import gc
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

from ldcs_ros.study.problems import ERROR_TIMES, scene_of
from ldcs_ros.study.tasks import Row, Task
from ldcs_ros.study.timing import best_of

MIB = 1024.0  # KiB


def growth(task: Task) -> list[Row]:
    """Return the row of one lattice size, measured in a process of its own; `extra` has its peak memory [MiB].

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    request = json.dumps([task.scene, task.nodes, task.value, task.runs])
    made = subprocess.run(
        [sys.executable, "-m", "ldcs_ros.study.growth", request], capture_output=True, text=True, check=False
    )
    if made.returncode != 0:
        last = (made.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(
            f"the process for {task.nodes} x {task.nodes} nodes ended with {made.returncode}: {last}"
        )
    values = json.loads(made.stdout)
    peak = values.pop("peak")
    extra = f"peak {peak:.0f}"
    return [
        Row("growth", task.scene, task.nodes, task.method, task.setting, task.value, extra=extra, **values)
    ]


def measure(scene: str, nodes: int, accuracy: float, runs: int) -> dict[str, Any]:
    """Return the cost of a whole run and the peak memory of this process [MiB]."""
    asked = scene_of(scene, nodes, accuracy=accuracy)
    # Loads and compiles; which kernels factor depends on the size. The model is built in the time that is measured, as
    # in every other row.
    asked.build().advance_to(1e-4)
    gc.collect()

    def run() -> Any:
        simulation = asked.build()
        simulation.advance_to(ERROR_TIMES[-1])
        return simulation.statistics

    cpu, counts = best_of(runs, run)
    return {
        "cpu": cpu / ERROR_TIMES[-1],
        "steps": counts.steps,
        "rejected": counts.rejected_steps,
        "evaluations": counts.evaluations,
        "factorisations": counts.factorisations,
        "peak": _peak(),
    }


def _peak() -> float:
    """Return the peak memory of this process [MiB]."""
    status = Path("/proc/self/status")
    if status.exists():
        # Of this program alone: the kernel's other figure begins with that of the process that started it.
        words = next(
            line for line in status.read_text(encoding="utf-8").splitlines() if line.startswith("VmHWM")
        )
        return float(words.split()[1]) / MIB
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MIB


def peak_memory(row: Row) -> float:
    """Return the peak memory of a growth row's process [MiB]."""
    words = row.extra.split()
    return float(words[words.index("peak") + 1])


def measured(rows: list[Row]) -> list[Row]:
    """Return the growth rows that have a cost, the smallest lattice first."""
    made = [row for row in rows if row.kind == "growth" and not row.failure]
    return sorted(made, key=lambda row: row.nodes)


def exponents(rows: list[Row]) -> tuple[float, float]:
    """Return the powers of the number of nodes by which CPU time grows: least squares over all, and end to end."""
    made = measured(rows)
    if len(made) < 2:
        return math.nan, math.nan
    points = [(math.log(float(row.nodes) ** 2), math.log(row.cpu)) for row in made]
    middle = sum(x for x, _ in points) / len(points), sum(y for _, y in points) / len(points)
    square = sum((x - middle[0]) ** 2 for x, _ in points)
    slope = sum((x - middle[0]) * (y - middle[1]) for x, y in points) / square
    (x0, y0), (x1, y1) = points[0], points[-1]
    return slope, (y1 - y0) / (x1 - x0)


if __name__ == "__main__":
    print(json.dumps(measure(*json.loads(sys.argv[1]))))

"""Speed against another checkout of this project: the same runs in turns, each in a process of its own.

The runs use the public interface alone, so a checkout of any age can be compared. The machine cancels out of a ratio.
"""

from __future__ import annotations

import json
import math
import os
import random
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.scene import load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.rows import Row, Task

ACCURACY, REFERENCE = 1e-5, 1e-7  # m
SPAN, LOOKS = 1.6, 200  # s, looks per second
MAXIMUM = {"paper": 0.1392, "rig": 140e3}  # N m, Pa
NOISE = {"smooth": 0.0, "noisy": 0.01}  # of the maximum
SHIPPED = 0.0  # Hz: the value of rows that run the shipped scene with its own commands
# (scene, commands, Hz) -> how many times the other checkout's speed is asked.
ASKED = {
    ("paper", "smooth", 100.0): 14.0,
    ("paper", "smooth", 1000.0): 16.0,
    ("rig", "smooth", 100.0): 5.0,
    ("rig", "smooth", 1000.0): 18.0,
    ("paper", "noisy", 100.0): 8.0,
    ("paper", "noisy", 1000.0): 14.0,
    ("rig", "noisy", 100.0): 4.0,
    ("rig", "noisy", 1000.0): 14.0,
    ("arc", "shipped", SHIPPED): 1.8,
    ("paper", "shipped", SHIPPED): 1.8,
    ("rig", "shipped", SHIPPED): 1.8,
}
WORKER = """
import json, sys, time
from ldcs_ros import load_scene
name, rate, values, span = json.load(sys.stdin)
scene = load_scene(name)
def run(simulation, end):
    for count, value in enumerate(values):
        if count / rate > end - 1e-9:
            break
        simulation.advance_to(count / rate)
        simulation.inputs.set_pressure(value) if name == "rig" else simulation.inputs.set_torque(value)
    simulation.advance_to(end)
run(scene.build(), 0.1)
simulation = scene.build()
began = time.thread_time()
run(simulation, span)
print(time.thread_time() - began)
"""


def commands(scene: str, kind: str, rate: float) -> list[float]:
    """Return the commands of a run [Pa or N m]: (1 - cos) / 2 of the maximum, noise on each where the kind says so."""
    if rate == SHIPPED:
        return []
    draw, most = random.Random(1), MAXIMUM[scene]
    course = (0.5 - 0.5 * math.cos(math.pi * count / rate) for count in range(round(SPAN * rate)))
    return [max(most * (value + NOISE[kind] * draw.gauss(0.0, 1.0)), 0.0) for value in course]


def paired_runs(task: Task) -> list[Row]:
    """Return the row of one kind of run: our CPU time and error, in `extra` the other checkout's CPU time.

    Args:
        task: Scene, kind of commands (`setting`), rate (`value`) and the other checkout's folder (`checkout`).

    Raises:
        RuntimeError: A process failed; the message is its last line.
    """
    import ldcs_ros

    here, other = Path(ldcs_ros.__file__).resolve().parents[1], Path(task.checkout).resolve()
    sent = commands(task.scene, task.setting, task.value)
    costs = {here: math.inf, other: math.inf}
    for _ in range(task.runs):
        for checkout in costs:
            costs[checkout] = min(costs[checkout], cpu_time(checkout, task.scene, task.value, sent, SPAN))
    known, _ = _looked_at(task.scene, task.value, sent, REFERENCE)
    motion, simulation = _looked_at(task.scene, task.value, sent, ACCURACY)
    row = task.row().counted(simulation.statistics).compared(motion, known, costs[here], SPAN)
    return [replace(row, extra=f"other {costs[other] / SPAN:.6g}")]


def cpu_time(
    checkout: Path, scene: str | dict[str, Any], rate: float, sent: list[float], span: float
) -> float:
    """Return the CPU time of a run in a process of a checkout [s].

    Args:
        checkout: Folder of the checkout.
        scene: Name of a scene that it ships, or a scene's content.
        rate: Rate of the commands [Hz].
        sent: Commands, one after another [Pa or N m].
        span: Simulated time [s].

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(checkout),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", WORKER],
        input=json.dumps([scene, rate, sent, span]),
        cwd=checkout,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(f"the run in {checkout} ended with {done.returncode}: {last}")
    return float(done.stdout.split()[-1])


def _looked_at(scene: str, rate: float, sent: list[float], accuracy: float) -> tuple[np.ndarray, Simulation]:
    content = load_scene(scene).content
    simulation = load_scene(
        {**content, "solver": {**content.get("solver", {}), "accuracy": accuracy}}
    ).build()
    found, count = [], 0
    for look in range(1, round(SPAN * LOOKS) + 1):
        while sent and count < len(sent) and count / rate < look / LOOKS - 1e-9:
            simulation.advance_to(count / rate)
            value = sent[count]
            simulation.inputs.set_pressure(value) if scene == "rig" else simulation.inputs.set_torque(value)
            count += 1
        simulation.advance_to(look / LOOKS)
        found.append(simulation.state.position)
    return np.array(found), simulation


@dataclass(frozen=True)
class PairedCost:
    """Our cost of a kind of run beside another checkout's.

    Attributes:
        row: Our row.
        times: The other's CPU time over ours.
        asked: The ratio that is asked.
    """

    row: Row
    times: float
    asked: float


def paired_costs(rows: Sequence[Row]) -> list[PairedCost]:
    """Return the ratios of the rows that have one."""
    made = [row for row in rows if row.kind == "paired" and not row.failure]
    return [
        PairedCost(row, float(row.extra.split()[-1]) / row.cpu, ASKED[row.scene, row.setting, row.value])
        for row in made
        if (row.scene, row.setting, row.value) in ASKED
    ]

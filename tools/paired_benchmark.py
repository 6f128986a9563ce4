"""Compare the speed of this checkout with another one, in turns on one machine: `tools/paired_benchmark.py CHECKOUT`.

Each row is a scene and the commands that it gets; the ratio is the other checkout's CPU time over this one's. Both run
in processes of this interpreter with one thread and use the public interface alone, so old checkouts can be compared.
In a row of a known course this checkout has the same commands as the scene's schedule, the other one gets them in turn.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

COMMANDED = [(scene, rate) for scene in ("paper", "rig") for rate in (100, 1000)]
# Scene, rate [Hz], noise, and whether the commands are known beforehand.
ROWS = [
    *((*row, noise, False) for noise in (0.0, 0.01) for row in COMMANDED),
    *((*row, 0.0, True) for row in COMMANDED),
    *((scene, 0, 0.0, False) for scene in ("arc", "paper", "rig")),
]
# Runs in either checkout: (1 - cos) course of torque or pressure, held between commands; 0 Hz is the shipped scene.
WORKER = """
import math, random, sys, time
from ldcs_ros import load_scene
name, rate, noise, span = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
is_known = sys.argv[5] == "True"
most = {"paper": 0.1392, "rig": 140e3}.get(name, 0.0)
kind = "pressure" if name == "rig" else "torque"
draw = random.Random(1)
course = []
for count in range(math.ceil(span * rate - 1e-9)):
    value = most * (0.5 - 0.5 * math.cos(math.pi * count / rate) + noise * draw.gauss(0.0, 1.0))
    course.append((count / rate, max(value, 0.0) if kind == "pressure" else value))
def run(simulation, end):
    for now, value in [] if is_known else course:
        if now >= end - 1e-9:
            break
        simulation.advance_to(now)
        simulation.inputs.set_pressure(value) if kind == "pressure" else simulation.inputs.set_torque(value)
    simulation.advance_to(end)
scene = load_scene(name)
if is_known:
    scene = scene.edited(inputs=[{"time": now, kind: value} for now, value in course])
run(scene.build(), 0.1)
simulation = scene.build()
began = time.thread_time()
run(simulation, span)
print(time.thread_time() - began)
"""


def cpu_time(checkout: Path, row: tuple[str, int, float], span: float, *, is_known: bool) -> float:
    """Return the CPU time of one run in a checkout [s]."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(checkout),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-c", WORKER, *map(str, row), str(span), str(is_known)]
    done = subprocess.run(command, cwd=checkout, env=environment, check=True, capture_output=True, text=True)
    return float(done.stdout.split()[-1])


def main() -> None:
    """Print one line a row."""
    parser = argparse.ArgumentParser(description="Compare the speed of this checkout with another one.")
    parser.add_argument("checkout", type=Path, help="the other checkout")
    parser.add_argument(
        "--rounds", type=int, default=3, help="runs of each row in each checkout; the least counts"
    )
    parser.add_argument("--span", type=float, default=1.6, help="simulated time of a run [s]")
    parser.add_argument("--known", action="store_true", help="rows of known courses alone")
    arguments = parser.parse_args()
    here, other = Path(__file__).resolve().parents[1], arguments.checkout.resolve()
    for scene, rate, noise, is_known in ROWS:
        if arguments.known and not is_known:
            continue
        best = {here: float("inf"), other: float("inf")}
        for _ in range(arguments.rounds):
            for checkout in best:
                known = is_known and checkout == here
                spent = cpu_time(checkout, (scene, rate, noise), arguments.span, is_known=known)
                best[checkout] = min(best[checkout], spent)
        what = f"{rate} Hz, noise {noise:g}" if rate else "smooth"
        what = f"{rate} Hz, known course" if is_known else what
        pace = arguments.span / best[here]
        print(
            f"{scene:6} {what:20} {best[other] / best[here]:5.2f} times the other, {pace:6.1f} x real time",
            flush=True,
        )


if __name__ == "__main__":
    main()

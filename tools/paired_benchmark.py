"""Compare the speed of this checkout with another one, in turns on one machine: `tools/paired_benchmark.py CHECKOUT`.

Each row is a scene and the commands that it gets; the ratio is the other checkout's CPU time over this one's. Both run
in processes of this interpreter with one thread and use the public interface alone, so old checkouts can be compared.
In a row of a known course this checkout has the same commands as the scene's schedule, the other one gets them in turn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ldcs_ros import load_scene
from ldcs_ros.study.paired_runs import ASKED, SPAN, commands, cpu_time

# Scene, kind of commands, rate [Hz], and whether the commands are known beforehand.
ROWS = [
    *((*row, False) for row in ASKED),
    *((scene, "smooth", rate, True) for scene in ("paper", "rig") for rate in (100.0, 1000.0)),
]


def main() -> None:
    """Print one line a row."""
    parser = argparse.ArgumentParser(description="Compare the speed of this checkout with another one.")
    parser.add_argument("checkout", type=Path, help="the other checkout")
    parser.add_argument(
        "--rounds", type=int, default=3, help="runs of each row in each checkout; the least counts"
    )
    parser.add_argument("--known", action="store_true", help="rows of known courses alone")
    arguments = parser.parse_args()
    here, other = Path(__file__).resolve().parents[1], arguments.checkout.resolve()
    for scene, kind, rate, is_known in ROWS:
        if arguments.known and not is_known:
            continue
        sent = commands(scene, kind, rate)
        drive = "pressure" if scene == "rig" else "torque"
        schedule = [{"time": count / rate, drive: value} for count, value in enumerate(sent)]
        content = load_scene(scene).edited(inputs=schedule).content if is_known else scene
        best = {here: float("inf"), other: float("inf")}
        for _ in range(arguments.rounds):
            for checkout in best:
                run = (content, rate, []) if is_known and checkout == here else (scene, rate, sent)
                best[checkout] = min(best[checkout], cpu_time(checkout, *run, SPAN))
        what = f"{rate:g} Hz, {'known course' if is_known else kind}" if rate else "shipped"
        pace = SPAN / best[here]
        print(
            f"{scene:6} {what:20} {best[other] / best[here]:5.2f} times the other, {pace:6.1f} x real time",
            flush=True,
        )


if __name__ == "__main__":
    main()

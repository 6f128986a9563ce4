"""Long runs under load and fault, and the table of what they gave: `make soak`, `make fuzz`, `make faults`.

Every run is a function that the tests call too, for seconds instead of an hour; here it gets its time, its rows are
kept in docs/under_load.json beside the machine and the command, and docs/under_load.md is written from all of them.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "test" / "ros")]
# As in the tests: shared memory only, checked fields, before rclpy is loaded.
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "SHM")
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
os.environ.pop("ROS_AUTOMATIC_DISCOVERY_RANGE", None)

# Run -> the module whose `rows(folder, tell, **options)` does it.
RUNS = {
    "soak": "soak",
    "flood": "flood",
    "joins": "joins",
    "kill": "killed",
    "disk": "full_disk",
    "fuzz": "fuzz",
}
TIMED = ("soak", "flood", "fuzz")


def main() -> int:
    """Do one run, or several one after the other; exit status 1 when a requirement was not kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", choices=RUNS)
    parser.add_argument("--seconds", type=float, help="how long a soak, a flood or a fuzz lasts")
    parser.add_argument("--seed", type=int, default=7, help="seed of the fuzzer")
    parser.add_argument("--no-replay", action="store_true", help="do not replay the bag of a soak")
    parser.add_argument("--keep", action="store_true", help="keep bags and logs in out/")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="where the table goes")
    arguments = parser.parse_args()
    passed = True
    for name in arguments.runs:
        passed = _one(name, arguments) and passed
    return 0 if passed else 1


def _one(name: str, arguments: argparse.Namespace) -> bool:
    from importlib import import_module

    from load_tables import save

    folder = ROOT / "out" / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    folder.mkdir(parents=True)
    options = {"seconds": arguments.seconds} if arguments.seconds and name in TIMED else {}
    if name == "fuzz":
        options["seed"] = arguments.seed
    if name == "soak":
        options["again"] = not arguments.no_replay
    began = time.monotonic()
    rows = import_module(RUNS[name]).rows(folder, _tell, **options)
    passed = all(row["kept"] for row in rows)
    for row in rows:
        print(f"{'ok ' if row['kept'] else 'NOT'} {row['what']}: {row['measured']} ({row['required']})")
    save(
        arguments.docs,
        name,
        {"machine": _machine(), "options": options, "took": time.monotonic() - began, "rows": rows},
    )
    if passed and not arguments.keep:
        shutil.rmtree(folder)
    else:
        print(f"bags and logs are in {folder}", file=sys.stderr)
    return passed


def _machine() -> dict[str, str]:
    from ldcs_ros.study.timing import machine

    commit = ["git", "rev-parse", "--short", "HEAD"]
    return {
        **machine(),
        "commit": subprocess.run(commit, cwd=ROOT, capture_output=True, text=True).stdout.strip(),
        "priority": f"nice {os.nice(0)}",
        "load average": f"{os.getloadavg()[2]:.1f}",
    }


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

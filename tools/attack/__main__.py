"""Attack the bridge with each event and write the table of docs/bridge.md: `make attack`, ATTACK='--only modbus'."""

from __future__ import annotations

import argparse
import itertools
import os
import re
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))
# Shared memory only, before rclpy is loaded.
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "SHM")
os.environ.pop("ROS_AUTOMATIC_DISCOVERY_RANGE", None)

from attack_run import SURVIVES, Row, Run  # noqa: E402
from attack_table import safe_rows, write_table  # noqa: E402
from bridge_process import prefer_devices  # noqa: E402
from events import Event, events  # noqa: E402
from random_answers import random_lines, random_modbus  # noqa: E402

IN_PROCESS = "output stage in process"
RANDOM_COUNT = 100_000
RANDOM = (
    ("100 000 random answers", "modbus", random_modbus),
    ("100 000 random lines", "serial", random_lines),
)
_numbers = itertools.count()


def attack(event: Event, folder: Path) -> Row:
    """Run one event in a ROS domain of its own."""
    number = next(_numbers)
    domain = 10 + (os.getpid() * 13 + number) % 220
    return Run(event, folder / f"{number:03d}", domain).measure()


def random_row(what: str, transport: str, run: Callable[[int], int]) -> Row:
    """Run 100 000 random answers against the output stage in process."""
    key = _random_key((what, transport, run))
    try:
        count = run(RANDOM_COUNT)
        row = replace(key, seen=f"{count} steps or lines, then zero confirmed")
    except Exception as error:  # any exception is a stage that has ended
        row = replace(key, faults=(repr(error),))
    print(f"{'safe  ' if row.safe else 'UNSAFE'} {transport:7} {IN_PROCESS}: {what} {'; '.join(row.faults)}")
    return row


def _random_key(one: tuple[str, str, Callable[[int], int]]) -> Row:
    return Row(one[0], one[1], IN_PROCESS, SURVIVES, None, None, "", None, ())


def main() -> int:
    """Run the events; return 1 when one is unsafe."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="pattern of the rows to run: transport, phase, event")
    parser.add_argument("--quick", action="store_true", help="the selection of the test suite")
    parser.add_argument("--slow", action="store_true", help="also the rows that take a minute")
    parser.add_argument("--keep", action="store_true", help="keep the files of each run")
    parser.add_argument("--missing", action="store_true", help="leave out rows that --write has as safe")
    parser.add_argument("--list", action="store_true", help="print the rows, run none")
    parser.add_argument("--write", type=Path, help="Markdown file in whose table the rows are replaced")
    arguments = parser.parse_args()
    chosen = [
        event
        for event in events()
        if (arguments.slow or not event.slow)
        and (event.quick or not arguments.quick)
        and re.search(arguments.only, f"{event.transport} {event.phase} {event.what}")
    ]
    if arguments.missing and arguments.write:
        known = safe_rows(arguments.write)
        chosen = [event for event in chosen if (event.transport, event.phase, event.what) not in known]
    if arguments.list:
        for event in chosen:
            print(f"{event.transport:7} {event.phase:28} {event.what} -> {event.outcome}")
        return 0
    prefer_devices()
    folder = ROOT / "out" / f"attack-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}"
    folder.mkdir(parents=True)
    rows = []
    order = [*events(), *map(_random_key, RANDOM)]
    began = time.monotonic()
    for event in chosen:
        row = attack(event, folder)
        rows.append(row)
        if arguments.write:
            write_table(arguments.write, [row], order)
        verdict = "safe  " if row.safe else "UNSAFE"
        print(
            f"{verdict} {row.transport:7} {row.phase}: {row.what}: zero {row.zero}, empty {row.empty}, "
            f"exit {row.exit_status}, saw {row.seen!r} {'; '.join(row.faults)}",
            flush=True,
        )
    if arguments.slow and re.search(arguments.only, IN_PROCESS):
        rows += [random_row(*one) for one in RANDOM]
    unsafe = [row for row in rows if not row.safe]
    print(f"{len(rows)} events in {time.monotonic() - began:.0f} s, {len(unsafe)} unsafe")
    if arguments.write:
        write_table(arguments.write, rows, order)
    if arguments.keep:
        print(f"files of each run: {folder}")
    else:
        shutil.rmtree(folder, ignore_errors=True)
    return 1 if unsafe else 0


if __name__ == "__main__":
    sys.exit(main())

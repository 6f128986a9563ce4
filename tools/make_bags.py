"""Make the reference bags in bags/ again: `make bags`, or this file with the names of some of them."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.messages.messages import pressure_command, wrench_command
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin
from ldcs_ros.twin.watchdog import Watchdog

BAGS = Path(__file__).resolve().parents[1] / "bags"
ACCURACY = 1e-7  # m, a hundred times what the scenes ask for
NOTHING = (0.0, 0.0, 0.0)


def paper() -> tuple[Twin, Callable[[Twin], None]]:
    """Return the paper's test by an independent reference method at a tight tolerance."""
    twin = Twin(load_scene("paper").edited(solver={"integrator": "radau", "accuracy": 1.0e-8}))
    return twin, lambda twin: twin.advance_to(3.0)


def chirp() -> tuple[Twin, Callable[[Twin], None]]:
    """Pressures that swing faster and faster, 0.3 to 4 Hz in 5 s, the arms half a turn apart at the end."""

    def command(twin: Twin) -> None:
        for k in range(251):
            time = k / 50.0
            phase = 2.0 * np.pi * (0.3 * time + 0.5 * (4.0 - 0.3) / 5.0 * time**2)
            left = 70e3 - 50e3 * np.cos(phase)
            right = 70e3 - 50e3 * np.cos(phase - np.pi * time / 5.0)
            twin.advance_to(time)
            twin.receive("pressure_command", pressure_command(np.round([left, right])))
        twin.advance_to(5.5)

    return Twin(load_scene("rig").without_schedule(), RunSettings(accuracy=ACCURACY)), command


def impulse() -> tuple[Twin, Callable[[Twin], None]]:
    """Return the lifted sheet at rest, pushed down at the free edge with 1 N for 20 ms, then free for 1.5 s."""
    twin = Twin(load_scene("paper_no_load"), RunSettings(accuracy=ACCURACY))
    twin.settle()

    def push(twin: Twin) -> None:
        start = twin.time
        for time, force in ((0.1, (0.0, 0.0, -1.0)), (0.12, NOTHING)):
            twin.advance_to(start + time)
            twin.receive("external_wrench", wrench_command(0, "P1_aligned", force, NOTHING))
        twin.advance_to(start + 1.6)

    return twin, push


def fault() -> tuple[Twin, Callable[[Twin], None]]:
    """Commands that are refused, a sender that falls silent, the vent, refusals until somebody rearms."""
    now = [0.0]
    watchdog = Watchdog(lambda: now[0], timeout=0.3, wrench_timeout=0.2)
    twin = Twin(load_scene("rig").without_schedule(), RunSettings(accuracy=ACCURACY), watchdog=watchdog)

    def send(twin: Twin, *values: float) -> None:
        twin.receive("pressure_command", pressure_command(np.array(values)))

    def go(twin: Twin, seconds: float) -> None:
        # The watchdog's steady clock is the simulation's here, looked at with each event as the node does.
        while twin.next_time <= seconds:
            twin.advance_to_next()
            now[0] = twin.time
            twin.check_watchdog()

    def run(twin: Twin) -> None:
        for k in range(10):
            go(twin, 0.1 * k)
            send(twin, 100e3, 80e3)
        send(twin, float("nan"), 80e3)
        send(twin, 5e6)
        send(twin, -1e3)
        send(twin, 1.0, 2.0, 3.0)
        twin.receive("external_wrench", wrench_command(0, "P9", (0.0, 0.0, 1.0), NOTHING))
        twin.receive("external_wrench", wrench_command(0, "P1", (0.0, 0.1, 0.0), NOTHING))
        twin.receive("pressure_command", b"\x00\x01\x00\x00\xff")
        go(twin, 1.9)
        send(twin, 60e3)
        go(twin, 2.0)
        twin.rearm()
        send(twin, 60e3)
        go(twin, 2.2)

    return twin, run


MAKERS: dict[str, Callable[[], tuple[Twin, Callable[[Twin], None]]]] = {
    "paper": paper,
    "chirp": chirp,
    "impulse": impulse,
    "fault": fault,
}


def make(name: str, folder: Path) -> Path:
    """Make one bag; the one that was there is replaced when the new one is whole."""
    twin, run = MAKERS[name]()
    fresh = folder / ".new" / name
    shutil.rmtree(fresh.parent, ignore_errors=True)
    recorder = Recorder(fresh, twin, custom_data={"made_by": f"tools/make_bags.py {name}"})
    twin.sinks.append(recorder)
    run(twin)
    recorder.close()
    if recorder.error is not None:
        raise SystemExit(f"make_bags: {recorder.error}")
    shutil.rmtree(folder / name, ignore_errors=True)
    fresh.rename(folder / name)
    fresh.parent.rmdir()
    return folder / name


def main() -> int:
    """Make the bags that are named, or all; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"out of {', '.join(MAKERS)}; all if none is named"
    )
    parser.add_argument(
        "--output", type=Path, default=BAGS, help="folder for the bags; bags/ of this checkout"
    )
    arguments = parser.parse_args()
    for name in arguments.names or MAKERS:
        if name not in MAKERS:
            parser.error(f"unknown bag '{name}', expected one of {list(MAKERS)}")
        path = make(name, arguments.output)
        size = sum(file.stat().st_size for file in path.iterdir())
        print(f"{path}: {size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())

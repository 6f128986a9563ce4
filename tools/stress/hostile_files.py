"""Mutated bags and YAML files given to every verb that reads them: `make hostile`, `make hostile COUNT=50 SEED=7`.

Each run is one verb on one file in a worker process. The verb must answer with an exit status that fits: 0, 1 with a
check that failed, or 2 with one line. Tracebacks, runs over 60 s, memory above 1 GB and files outside of the asked
folder are counted. The exit status is 1 if any count is not zero.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

sys.path.insert(0, str(Path(__file__).parent))
from mutations import mutate_bag, mutate_text

SECONDS = 60
LONGEST_WAIT = 240
MEGABYTES = 1024
ADDRESS_SPACE = 6 * 2**30
FAULTS = ("traceback", "over 60 s", "memory above 1 GB", "file outside", "wrong exit", "worker died")
WORKERS = 2
Runs = Counter[tuple[str, int]]

SHEET = """
title: A small sheet for hostile files
lattice: {size: [0.140, 0.140, 0.010], nodes: [3, 3], mass: 0.160}
points: {P0: [mid, centre], P1: [mid, free_edge]}
effects:
  - {type: springs, stiffness: 80.0, damping: 5.0}
  - {type: gravity}
  - {type: clamp, edge: x_min}
  - {type: arms, drive: pressure}
  - {type: wrench}
sensors:
  tracker: {points: [P0, P1], rate: 80.0, delay: 0.02, noise: 1.0e-4, seed: 3}
  pressure: {rate: 50.0, noise: 50.0}
inputs: [{time: 0.0, pressure: 5.0e4}]
solver: {integrator: auto, accuracy: 1.0e-3}
"""
MAPPING = """
time: stamp
commands:
  - {topic: /v, to: pressure_command, unit: Pa, arms: [left]}
measurements:
  - {topic: /tracker, to: P1, child: tip, unit: mm, translation: [0.05, 0, 0], rotation: [0, 1, 0, 0]}
  - {topic: /tracker, to: P0, child: base}
"""
TOLERANCES = 'P1: {max: 1.0e-3, rms: 5.0e-4}\nP*.z: {end: 2.0e-4}\nsurface: {max: 2.0e-5}\n"*/pressure": {rms: 500.0}\n'
RIG = """
title: A rig for hostile files
limits: {pressure: 120.0e+3, slew: 400.0e+3, vent_ramp: 0.3, vent_time: 1.0, command_timeout: 0.4, rig_timeout: 0.4}
links:
  - {type: modbus, host: 127.0.0.1, port: 1502, device: 1, rate: 50.0, unit: mbar, setpoint: 0, actual: 10}
"""


def make_seeds(folder: Path) -> None:
    """Record the bags and write the files that are mutated."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    from ldcs_ros.cli.main import main

    (folder / "scene.yaml").write_text(SHEET)
    (folder / "mapping.yaml").write_text(MAPPING)
    (folder / "tolerances.yaml").write_text(TOLERANCES)
    (folder / "rig.yaml").write_text(RIG)
    with contextlib.redirect_stdout(io.StringIO()):
        own = ["simulate", str(folder / "scene.yaml"), "--duration", "0.3", "--bag", str(folder / "own")]
        assert main(own) == 0
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    for name, plugin in (("rig_mcap", StoragePlugin.MCAP), ("rig_sqlite3", StoragePlugin.SQLITE3)):
        with Writer(folder / name, version=8, storage_plugin=plugin) as writer:
            fluid, tf = "sensor_msgs/msg/FluidPressure", "geometry_msgs/msg/TransformStamped"
            valves = writer.add_connection("/v", fluid, typestore=store)
            tracker = writer.add_connection("/tracker", tf, typestore=store)
            for k in range(30):
                now = 1_700_000_000_000_000_000 + k * 10_000_000
                stamp = types["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
                header = types["std_msgs/msg/Header"](stamp, "trakstar_base")
                message = types[fluid](header, 101325.0 + 1e3 * k, 0.0)
                writer.write(valves, now, store.serialize_cdr(message, fluid))
                vector = types["geometry_msgs/msg/Vector3"](0.07 + 1e-3 * k, 0.0, 1e-3 * k)
                still = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
                place = types["geometry_msgs/msg/Transform"](vector, still)
                message = types[tf](header, "base" if k % 2 else "tip", place)
                writer.write(tracker, now + 1000, store.serialize_cdr(message, tf))


def bag_runs(seeds: Path, work: Path, draw: random.Random) -> Iterator[tuple[str, list[str]]]:
    """Yield (verb, words) of the six verbs on one mutated bag below `work`; all write into `work/out`."""
    name = draw.choice(("own", "own", "rig_mcap", "rig_sqlite3"))
    bag, out = work / "bag", work / "out"
    shutil.copytree(seeds / name, bag)
    mutate_bag(bag, draw)
    scene, mapping = str(seeds / "scene.yaml"), str(seeds / "mapping.yaml")
    rig = [] if name == "own" else ["--map", mapping]
    given = [] if name == "own" else ["--scene", scene]
    yield "replay", ["replay", str(bag), "--bag", str(out / "replay"), *rig, *given]
    maps = [] if name == "own" else ["--map-a", mapping]
    limits = ["--tolerances", str(seeds / "tolerances.yaml")] if name == "own" else []
    yield "compare", ["compare", str(bag), str(seeds / "own"), "-o", str(out / "compare"), *maps, *limits]
    yield "plot", ["plot", str(bag), "-o", str(out / "plot")]
    yield "view", ["view", str(bag), "--markers", str(out / "markers")]
    fit = [
        "--fit",
        "effects.springs.stiffness=60..100",
        "--starts",
        "1",
        "--processes",
        "1",
        "--noise",
        "1e-3",
    ]
    yield "identify", ["identify", str(bag), *fit, "-o", str(out / "fitted.yaml"), *rig, *given]
    yield "recover", ["recover", str(bag)]


def yaml_runs(seeds: Path, work: Path, draw: random.Random) -> Iterator[tuple[str, list[str]]]:
    """Yield (kind, words) of the verb that reads one mutated file."""
    kind = draw.choice(("scene", "scene", "mapping", "tolerances", "rig"))
    file, out = work / "file.yaml", work / "out"
    text = mutate_text((seeds / f"{kind}.yaml").read_text(), draw)
    file.write_bytes(text.encode(errors="surrogatepass"))
    own, bag = str(seeds / "own"), str(seeds / "rig_mcap")
    yield (
        kind,
        {
            "scene": ["simulate", str(file), "--duration", "0.01", "--bag", str(out / "bag")],
            "mapping": ["compare", bag, own, "--map-a", str(file), "-o", str(out / "compare")],
            "tolerances": ["compare", own, own, "--tolerances", str(file), "-o", str(out / "compare")],
            "rig": ["rig", str(file)],
        }[kind],
    )


def run(words: list[str]) -> int:
    """Run a verb; `rig` reads a rig file."""
    from ldcs_ros.cli.main import main
    from ldcs_ros.errors import LdcsError
    from ldcs_ros.rig.rig_file import load_rig

    if words[0] != "rig":
        return main(words)
    try:
        load_rig(words[1])
    except LdcsError as error:
        print(f"ldcs: error: {error}", file=sys.stderr)
        return 2
    return 0


class _Overtime(BaseException):
    """A run took longer than SECONDS."""


def _alarm(*_: object) -> NoReturn:
    raise _Overtime


def _peak() -> int:
    """Return the largest memory since it was last reset [MB]."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) // 1024


def judge(words: list[str], work: Path) -> tuple[int, list[str], str]:
    """Return the exit status and the faults of one run, and a description of the first."""
    out, err = io.StringIO(), io.StringIO()
    faults: list[str] = []
    detail, status = "", -1
    Path("/proc/self/clear_refs").write_text("5")
    # Other work of the machine does not count; a verb that only waits is ended, too.
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.alarm(LONGEST_WAIT)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = run(words)
    except _Overtime:
        faults.append("over 60 s")
    except BaseException:
        faults.append("traceback")
        detail = traceback.format_exc()
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    if _peak() > MEGABYTES:
        faults.append("memory above 1 GB")
        detail = detail or f"{_peak()} MB"
    lines = [line for line in err.getvalue().splitlines() if line.startswith("ldcs: error:")]
    reported = [
        line for line in err.getvalue().splitlines() if line.strip() and not line.startswith("ldcs: note:")
    ]
    expected = {0: lines == [], 1: len(lines) <= 1, 2: len(lines) == 1 and reported == lines}.get(status, False)
    if not faults and not expected:
        faults.append("wrong exit")
        detail = f"status {status}, stderr {err.getvalue()[-600:]!r}"
    allowed = {"bag", "file.yaml", "out"}
    if {path.name for path in work.iterdir()} - allowed:
        faults.append("file outside")
        detail = detail or str(sorted(path.name for path in work.iterdir()))
    return status, faults, detail


def worker(seeds: Path, first: int, step: int, bags: int, files: int, seed: int) -> int:
    """Judge every `step`th bag and file from `first` on; print a line for each fault, and one a job."""
    os.nice(2)
    signal.signal(signal.SIGALRM, _alarm)
    signal.signal(signal.SIGPROF, _alarm)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    base = Path(tempfile.mkdtemp(prefix="ldcs_hostile_"))
    try:
        for job in range(first, bags + files, step):
            draw = random.Random(f"{seed}/{job}")
            work, temporary = base / f"{job}" / "work", base / f"{job}" / "tmp"
            temporary.mkdir(parents=True)
            (work / "out").mkdir(parents=True)
            tempfile.tempdir = str(temporary)
            os.environ["TMPDIR"] = str(temporary)
            os.chdir(work)
            runs = bag_runs(seeds, work, draw) if job < bags else yaml_runs(seeds, work, draw)
            for kind, words in runs:
                status, faults, detail = judge(words, work)
                left = sorted(path.name for path in temporary.iterdir())
                if left:
                    faults.append("file outside")
                    detail = detail or f"left in the temporary folder: {left}"
                names = ",".join(fault.replace(" ", "_") for fault in faults) or "-"
                print(f"RUN {job} {kind} {status} {names}", flush=True)
                if faults:
                    print(
                        f"FAULT {job} {kind}: {faults}: {' '.join(words)}\n{detail}",
                        file=sys.stderr,
                        flush=True,
                    )
            os.chdir(base)
            shutil.rmtree(base / f"{job}", ignore_errors=True)
    finally:
        os.chdir("/")
        shutil.rmtree(base, ignore_errors=True)
    return 0


def drive(bags: int, files: int, seed: int, tell: Callable[[str], None]) -> tuple[Runs, Counter[str]]:
    """Judge all jobs in worker processes; return runs by kind and exit status, and faults by name."""
    runs: Runs = Counter()
    faults: Counter[str] = Counter({name: 0 for name in FAULTS})
    with tempfile.TemporaryDirectory(prefix="ldcs_hostile_seeds_") as folder:
        make_seeds(Path(folder))
        base = [sys.executable, __file__, "--worker", folder, "--bags", str(bags), "--files", str(files)]
        base += ["--seed", str(seed)]
        active = {first: _start([*base, "--first", str(first)]) for first in range(WORKERS)}
        done = dict.fromkeys(active, -1)
        started = time.monotonic()
        while active:
            for first, process in list(active.items()):
                line = process.stdout.readline() if process.stdout is not None else ""
                if line.startswith("RUN "):
                    _, job, kind, status, found = line.split()
                    done[first] = int(job)
                    runs[kind, int(status)] += 1
                    faults.update(name.replace("_", " ") for name in found.split(",") if name != "-")
                    if sum(runs.values()) % 500 == 0:
                        tell(
                            f"{sum(runs.values())} runs in {time.monotonic() - started:.0f} s: {dict(faults)}"
                        )
                elif not line:
                    del active[first]
                    if process.wait() != 0:
                        faults["worker died"] += 1
                        further = max(done[first], first - WORKERS) + WORKERS
                        tell(f"a worker died with {process.returncode} in job {further} or before")
                        if further + WORKERS < bags + files:
                            active[first] = _start([*base, "--first", str(further + WORKERS)])
                            done[first] = further
    return runs, faults


def _start(words: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def main() -> int:
    """Run, print the table, return 1 if a count is not zero."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bags", type=int, default=1000, help="mutated bags, each for six verbs")
    parser.add_argument("--files", type=int, default=3000, help="mutated YAML files")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--first", type=int, default=0, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.worker is not None:
        return worker(asked.worker, asked.first, WORKERS, asked.bags, asked.files, asked.seed)
    runs, faults = drive(asked.bags, asked.files, asked.seed, lambda line: print(line, flush=True))
    print(f"{sum(runs.values())} runs\n\n| read by | exit 0 | exit 1 | exit 2 |\n|---|---|---|---|")
    for kind in dict.fromkeys(kind for kind, _ in runs):
        print(f"| {kind} | " + " | ".join(str(runs[kind, status]) for status in range(3)) + " |")
    print()
    print("| fault | asked | found |\n|---|---|---|")
    for name in FAULTS:
        print(f"| {name} | 0 | {faults[name]} |")
    return 1 if any(faults.values()) else 0


if __name__ == "__main__":
    sys.exit(main())

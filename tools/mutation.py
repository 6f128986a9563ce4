"""Mutation testing of the inner rooms with cosmic-ray: a seeded sample of changes, each against the tests that run it.

`make mutants`: each room is changed in a copy of the checkout; status 1 if fewer than the asked fraction of the changes
is caught. Coverage of each test decides which tests a change meets, the fastest first. The table of docs/mutation.md is
the output of this program.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from cosmic_ray.work_item import WorkItem

ROOT = Path(__file__).resolve().parents[1]
# Left out: unions of types, identity of numbers, operators that no float has, and decorators: `compiled` changes no
# result. The switch between compiled and plain kernels changes no result either.
EXCLUDED_FILES = ["ldcs_ros/physics/compiled.py"]
EXCLUDED = re.compile(r"BitOr|BitAnd|BitXor|Shift|RemoveDecorator|Comparison.*_(Is|IsNot)$")
# Also left out: switches that only detect misuse.
MISUSE = re.compile(r"frozen=|strict=")
CLIENT = """import socket, sys
connection = socket.socket(socket.AF_UNIX)
connection.connect("tests.sock")
sys.exit((connection.recv(1) or bytes([1]))[0])
"""
LIBRARIES = (
    "numpy.testing", "scipy.linalg", "scipy.sparse.linalg", "scipy.integrate", "scipy.interpolate", "scipy.optimize",
    "scipy.spatial", "hypothesis", "matplotlib.figure", "rosbags.rosbag2", "rosbags.typesys", "yaml", "threadpoolctl",
    "pytest_timeout", "_pytest.assertion.rewrite",
)  # fmt: skip
KERNEL = re.compile(r"^@compiled", re.MULTILINE)
# A change meets at least so many tests, and more up to a duration [s]; their time limit [s].
MIN_TESTS, BUDGET, LIMIT = 15, 30.0, 60.0


@dataclass(frozen=True)
class Room:
    """A room with its tests.

    Attributes:
        count: Changes to try.
        tests: Arguments of pytest.
        compiled: Whether kernels are compiled: not in `physics`, whose tests are short without, and where a cached
            kernel could hide a change of a kernel that it calls.
    """

    count: int
    tests: tuple[str, ...]
    compiled: bool


ROOMS = {
    "signals": Room(85, ("test/signals",), compiled=False),
    "twin": Room(55, ("test/twin",), compiled=False),
    "simulation": Room(45, ("test/simulation",), compiled=True),
    "physics": Room(60, ("test/physics",), compiled=False),
    # Those of its tests that start no process.
    "rig": Room(
        50,
        (
            "test/rig/test_numbers_of_the_limits.py",
            "test/rig/test_limits_in_two_places.py",
            "test/rig/test_rig_readings.py",
            "test/rig/test_rig_file_checks.py",
            "test/rig/test_write_monitor.py",
        ),
        compiled=False,
    ),
    "integrators": Room(40, ("test/integrators",), compiled=True),
}


def sample(items: Sequence[WorkItem], checkout: Path, count: int, seed: int) -> list[WorkItem]:
    """Return one change at each of `count` places; a place is one operator or constant of the source."""
    places: dict[tuple[str, tuple[int, int]], list[WorkItem]] = {}
    for item in items:
        mutation = item.mutations[0]
        line = (
            (checkout / mutation.module_path)
            .read_text(encoding="utf-8")
            .splitlines()[mutation.start_pos[0] - 1]
        )
        if not (EXCLUDED.search(mutation.operator_name) or MISUSE.search(line)):
            places.setdefault((str(mutation.module_path), mutation.start_pos), []).append(item)
    draw = random.Random(seed)
    chosen = draw.sample(sorted(places), min(count, len(places)))

    def kind(item: WorkItem) -> tuple[str, int]:
        return item.mutations[0].operator_name, item.mutations[0].occurrence

    return [draw.choice(sorted(places[place], key=kind)) for place in sorted(chosen)]


def measure_tests(name: str, room: Room, checkout: Path, environment: dict[str, str]) -> None:
    """Run a room's tests without a change; write which test runs which line, and their durations, into tests.json."""
    from coverage import CoverageData

    options = [
        f"--cov=ldcs_ros.{name}",
        "--cov-context=test",
        "--cov-report=",
        "--cov-fail-under=0",
        "--junitxml=tests.xml",
    ]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options, *room.tests]
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"the tests of {name} fail without a change:\n{done.stdout[-3000:]}")
    durations = {
        f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}": float(case.get("time", "0"))
        for case in ElementTree.parse(checkout / "tests.xml").iter("testcase")
    }
    data = CoverageData(str(checkout / ".coverage"))
    data.read()
    lines = {
        str(Path(file).relative_to(checkout)): {
            line: sorted({context.partition("|")[0] for context in contexts} & set(durations))
            for line, contexts in data.contexts_by_lineno(file).items()
        }
        for file in data.measured_files()
    }
    (checkout / "tests.json").write_text(
        json.dumps({"lines": lines, "durations": durations}), encoding="utf-8"
    )


def serve(room: str) -> None:
    """Run the tests of the present change for each connection, in a fork that has all libraries already.

    The answer is one byte, 0 for tests that pass; none for tests that end the process or take too long.
    """
    for library in (*LIBRARIES, *(["numba"] if ROOMS[room].compiled else [])):
        with contextlib.suppress(ImportError):
            import_module(library)
    os.nice(10)
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # they take longer than most of these tests
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("tests.sock")
        server.listen()
        while True:
            connection, _ = server.accept()
            child = os.fork()
            if child == 0:
                tests = tests_of_the_change(room)
                # A change that no test runs survives.
                status = (
                    pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-p", "pytest_timeout", *tests])
                    if tests
                    else 0
                )
                connection.sendall(bytes([min(int(status), 255)]))
                os._exit(0)
            connection.close()
            deadline = time.monotonic() + LIMIT
            while os.waitpid(child, os.WNOHANG) == (0, 0):
                if time.monotonic() > deadline:
                    os.kill(child, signal.SIGKILL)
                time.sleep(0.01)


def tests_of_the_change(room: str) -> list[str]:
    """Return the tests that run the changed lines of the checkout here, the fastest first."""
    known = json.loads(Path("tests.json").read_text(encoding="utf-8"))
    for path in sorted(Path("ldcs_ros", room).rglob("*.py")):
        before, after = (
            (folder / path).read_text(encoding="utf-8").splitlines() for folder in (Path("unchanged"), Path())
        )
        if before == after:
            continue
        lines = known["lines"].get(str(path), {})
        numbers = [k for k, (a, b) in enumerate(zip_longest(before, after), start=1) if a != b]
        found = {test for number in numbers for test in lines.get(str(number), [])}
        if not found:
            # Run at import, or compiled: the tests of the file, or of the room for a kernel.
            found = {test for tests in lines.values() for test in tests}
            if KERNEL.search("\n".join(before)):
                # Compiled here in any case: some kernels have no use without numba, and their tests come first.
                found = set(known["durations"])
                os.environ.pop("LDCS_NO_NUMBA", None)
                os.environ["NUMBA_CACHE_DIR"] = str(Path("kernels").absolute())
                shutil.rmtree("kernels", ignore_errors=True)
        chosen, spent = [], 0.0
        for test in sorted(found, key=lambda test: known["durations"][test]):
            spent += known["durations"][test]
            if len(chosen) >= MIN_TESTS and spent > BUDGET:
                break
            chosen.append(test)
        return chosen
    raise SystemExit("no change in this checkout")


def run_room(name: str, room: Room, folder: Path, *, count: int, seed: int) -> tuple[int, int, list[str]]:
    """Try a room's changes in a copy; return the numbers tried and caught, and the survivors in words."""
    from cosmic_ray.work_db import WorkDB, use_db
    from cosmic_ray.work_item import TestOutcome

    checkout = folder / "checkout"
    unused = shutil.ignore_patterns(".git", ".venv", "out", "build", ".*_cache", "kernels-*")
    shutil.copytree(ROOT, checkout, ignore=unused)
    shutil.copytree(checkout / "ldcs_ros" / name, checkout / "unchanged" / "ldcs_ros" / name)
    environment = {
        **os.environ,
        "PYTHONPATH": f"{checkout}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        # One cache for all changes: a kernel is compiled again when its own file changes.
        **({"NUMBA_CACHE_DIR": str(checkout / "kernels")} if room.compiled else {"LDCS_NO_NUMBA": "1"}),
    }
    measure_tests(name, room, checkout, environment)
    # A cached module would hide a change within the same second and of the same length.
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    (checkout / "client.py").write_text(CLIENT, encoding="utf-8")
    (checkout / "session.toml").write_text(
        f'[cosmic-ray]\nmodule-path = "ldcs_ros/{name}"\ntimeout = {LIMIT + 30.0}\n'
        f"excluded-modules = {EXCLUDED_FILES}\n"
        f'test-command = "{sys.executable} -I client.py"\n[cosmic-ray.distributor]\nname = "local"\n',
        encoding="utf-8",
    )
    session = ["session.toml", "session.sqlite"]
    cosmic_ray = [sys.executable, "-m", "cosmic_ray.cli"]
    subprocess.run([*cosmic_ray, "init", *session], cwd=checkout, check=True)
    with use_db(checkout / session[1], WorkDB.Mode.open) as database:
        chosen = sample(list(database.work_items), checkout, count, seed)
        database.clear()
        database.add_work_items(chosen)
    server = subprocess.Popen(
        [sys.executable, __file__, "--serve", name],
        cwd=checkout,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        while not (checkout / "tests.sock").exists():
            if server.poll() is not None:
                raise SystemExit(f"the server of the tests of {name} ended with {server.returncode}")
            time.sleep(0.1)
        subprocess.run(
            ["nice", "-n", "10", *cosmic_ray, "exec", *session], cwd=checkout, env=environment, check=True
        )
    finally:
        server.kill()
        server.wait()
    with use_db(checkout / session[1], WorkDB.Mode.open) as database:
        alive = {
            job: result.diff or ""
            for job, result in database.results
            if result.test_outcome == TestOutcome.SURVIVED
        }
    words = [_words(item, alive[item.job_id]) for item in chosen if item.job_id in alive]
    return len(chosen), len(chosen) - len(alive), words


def _words(item: WorkItem, diff: str) -> str:
    """Return the place and the change of a survivor."""
    mutation = item.mutations[0]
    removed, added = (
        next((line[1:].strip() for line in diff.splitlines() if re.match(rf"\{sign}(?!\{sign})", line)), "")
        for sign in "-+"
    )
    return f"{mutation.module_path}:{mutation.start_pos[0]}: `{removed}` -> `{added}`"


def main() -> int:
    """Try the sample of each room; exit status 0 if enough of the changes are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", default=list(ROOMS), help=f"rooms out of {list(ROOMS)}")
    parser.add_argument("--count", type=int, help="changes of each room; a number for each room if not given")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    parser.add_argument("--caught", type=float, default=0.9, help="fraction that must be caught")
    parser.add_argument(
        "--serve", metavar="ROOM", help="only serve the tests of the changes in the folder here"
    )
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments.serve)
    print("| room | tried | caught | caught [%] | time [s] |\n|---|---|---|---|---|", flush=True)
    tried = caught = 0
    survivors: list[str] = []
    for name in arguments.rooms:
        room, began = ROOMS[name], time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            count = arguments.count or room.count
            made, found, words = run_room(name, room, Path(folder), count=count, seed=arguments.seed)
        took = time.monotonic() - began
        print(f"| {name} | {made} | {found} | {100 * found / made:.0f} | {took:.0f} |", flush=True)
        tried, caught, survivors = tried + made, caught + found, survivors + words
    print(f"| all | {tried} | {caught} | {100 * caught / tried:.0f} | |\n")
    print(*(f"- {words}" for words in survivors), sep="\n")
    return 0 if caught >= arguments.caught * tried else 1


if __name__ == "__main__":
    sys.exit(main())

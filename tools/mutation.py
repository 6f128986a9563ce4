"""Mutation testing of the inner rooms with cosmic-ray: a seeded sample of changes, each against the tests that run it.

`make mutants`: each room is changed in a copy of the checkout; status 1 if fewer than the asked fraction of the changes
is caught. Coverage of each test decides which tests a change meets, the fastest first, until the first failure. Each
verdict is a line of out/mutants.csv: a stopped run goes on with the next change. `--again` tries the survivors in
that file again. `--write` puts the table of all rooms into docs/mutation.md.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import csv
import hashlib
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from mutants import COMPILED, ROOMS, Change, sample

ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = (
    "numpy.testing", "scipy.linalg", "scipy.sparse.linalg", "scipy.integrate", "scipy.interpolate", "scipy.optimize",
    "scipy.spatial", "hypothesis", "matplotlib.figure", "rosbags.rosbag2", "rosbags.typesys", "yaml", "threadpoolctl",
    "pytest_timeout", "_pytest.assertion.rewrite", "coverage",
)  # fmt: skip
# A change meets at least so many tests, and more up to a processor time [s].
MIN_TESTS, BUDGET = 8, 6.0
# Limits of a change: its processor time [s], which a loaded machine does not shorten; so many times that by the clock.
LIMIT, PATIENCE = 30, 20.0
RESULTS, PAGE = ROOT / "out" / "mutants.csv", ROOT / "docs" / "mutation.md"
# Fraction of the changes that are to be caught, without those that change no result.
ASKED = 0.9
CAUGHT, STOPPED, LATER, SURVIVED = "caught", "stopped", "caught later", "survived"
TABLE = re.compile(r"(?<=<!-- figures -->\n).*?(?=<!-- end of figures -->)", re.DOTALL)


class Durations:
    """A plugin of pytest that measures the processor time of each test, with that of its processes [s]."""

    def __init__(self) -> None:
        self.of: dict[str, float] = {}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Run a test and note its time."""
        began = sum(os.times()[:4])
        yield
        self.of[item.nodeid] = sum(os.times()[:4]) - began


def in_a_fork(run: Callable[[], int], limit: int) -> int | None:
    """Return the status of a function that runs in a fork, which has all libraries already; None if it takes too long.

    Args:
        run: The function; it returns the status.
        limit: Processor time that it may take [s]; it may take PATIENCE times as long by the clock.
    """
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
            status = run()
        finally:
            os._exit(status)
    deadline = time.monotonic() + PATIENCE * limit
    while (ended := os.waitpid(child, os.WNOHANG)) == (0, 0):
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.01)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # processes that its tests left
    status = os.waitstatus_to_exitcode(ended[1])
    return None if status in (-signal.SIGXCPU, -signal.SIGKILL) else status


def measured(room: str) -> Path:
    """Return the file with the tests of each line and their durations, kept for these sources and tests."""
    places = [f"ldcs_ros/{folder}" for folder in ROOMS[room].folders] + [
        test for test in ROOMS[room].tests if Path(test).exists()
    ]
    found = {path for place in places for path in (Path(place), *Path(place).rglob("*.py")) if path.is_file()}
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(found))).hexdigest()[:16]
    return RESULTS.parent / f"mutants-{room}-{digest}.json"


def measure_tests(room: str, kept: Path) -> int:
    """Run a room's tests without a change; write which test runs which line, and their durations, into a file."""
    from coverage import CoverageData

    quiet = ["-q", "-p", "no:cacheprovider", "--timeout=0", "--cov-fail-under=0"]
    durations = Durations()
    covered = [f"--cov=ldcs_ros/{folder}" for folder in ROOMS[room].folders]
    options = [*quiet, *covered, "--cov-context=test", "--cov-report="]
    if pytest.main([*options, *ROOMS[room].tests], plugins=[durations]) != 0:
        return 1
    # Once more, as durations must not hold the compilation of kernels, or a change would meet few tests.
    slow = [test for test, duration in durations.of.items() if duration > BUDGET]
    if slow:
        pytest.main([*quiet, *slow], plugins=[durations])
    data = CoverageData(".coverage")
    data.read()
    lines = {
        str(Path(file).relative_to(Path.cwd())): {
            line: sorted({context.partition("|")[0] for context in contexts} & set(durations.of))
            for line, contexts in data.contexts_by_lineno(file).items()
        }
        for file in data.measured_files()
    }
    kept.write_text(json.dumps({"lines": lines, "durations": durations.of}), encoding="utf-8")
    return 0


def tests_of(change: Change, changed: str, known: dict[str, Any]) -> list[str]:
    """Return the tests that run the changed lines, the fastest first."""
    source = change.path.read_text(encoding="utf-8")
    of_file = known["lines"].get(str(change.path), {})
    pairs = zip_longest(source.splitlines(), changed.splitlines())
    numbers = [k for k, (a, b) in enumerate(pairs, start=1) if a != b]
    found = {test for number in numbers for test in of_file.get(str(number), [])}
    if not found:
        # Run at import: the tests that run a line with the constant's name, else those of the file, or of the room.
        names = _assigned(source, change.line)
        word = re.compile(rf"\b({'|'.join(names)})\b") if names else None
        for path, lines in known["lines"].items() if word is not None else ():
            for number, text in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), start=1):
                if word.search(text):
                    found.update(lines.get(str(number), []))
        found = found or {test for tests in of_file.values() for test in tests} or set(known["durations"])
    chosen, spent = [], 0.0
    for test in sorted(found, key=lambda test: known["durations"][test]):
        spent += known["durations"][test]
        if spent > (BUDGET if len(chosen) >= MIN_TESTS else LIMIT / 3.0):
            break
        chosen.append(test)
    return chosen


def _assigned(source: str, line: int) -> list[str]:
    """Return the names of a file that the statement at a line outside functions and classes sets."""
    for node in ast.parse(source).body:
        if node.lineno <= line <= (node.end_lineno or 0) and isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            parts = [part for target in targets for part in ast.walk(target)]
            return [part.id for part in parts if isinstance(part, ast.Name)]
    return []


def try_change(change: Change, known: dict[str, Any]) -> dict[str, str]:
    """Return what a change removes and adds, and its verdict; the file is whole again afterwards."""
    source, times = change.path.read_text(encoding="utf-8"), change.path.stat()
    changed = change.changed(source) or ""
    tests = tests_of(change, changed, known)

    def run() -> int:
        sys.dont_write_bytecode = True
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # they take longer than most of these tests
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "pytest_timeout", "--timeout=0"]
        # A change that no test runs survives.
        return int(pytest.main([*options, *tests])) if tests else 0

    change.path.write_text(changed, encoding="utf-8")
    try:
        status = in_a_fork(run, LIMIT)
    finally:
        change.path.write_text(source, encoding="utf-8")
        os.utime(change.path, ns=(times.st_atime_ns, times.st_mtime_ns))  # its bytecode is valid again
    pairs = list(zip_longest(source.splitlines(), changed.splitlines(), fillvalue=""))
    removed, added = next((a.strip(), b.strip()) for a, b in pairs if a != b)
    verdict = STOPPED if status is None else SURVIVED if status == 0 else CAUGHT
    return {"removed": removed, "added": added, "verdict": verdict}


def try_room(room: str, seed: int, count: int, *, again: bool) -> None:
    """Try a sample of a room's changes in the checkout here, or its former survivors; keep each verdict."""
    # Kernels that no change touches are compiled once, whatever the age of their file.
    with contextlib.suppress(ImportError):
        caching = import_module("numba.core.caching")
        locator = caching._SourceFileBackedLocatorMixin  # noqa: SLF001  # numba has no public name for it
        locator.get_source_stamp = lambda _: (0.0, 0)
    for library in LIBRARIES:
        with contextlib.suppress(ImportError):
            import_module(library)
    kept = measured(room)
    if not kept.exists() and in_a_fork(lambda: measure_tests(room, kept), 3600) != 0:
        raise SystemExit(f"the tests of {room} fail without a change")
    known = json.loads(kept.read_text(encoding="utf-8"))
    rows = read_rows(seed)
    for change in sample(room, seed, count):
        key = {name: str(value) for name, value in asdict(change).items()}
        before = next((row for row in rows if row["room"] == room and key.items() <= row.items()), None)
        if before is not None and not (again and before["verdict"] == SURVIVED):
            continue
        row = {"seed": str(seed), "room": room, **key, **try_change(change, known)}
        if before is not None:
            row["verdict"] = SURVIVED if row["verdict"] == SURVIVED else LATER
            rows.remove(before)
        rows.append(row)
        with RESULTS.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(row))
            writer.writeheader()
            writer.writerows(rows)


def read_rows(seed: int) -> list[dict[str, str]]:
    """Return the verdicts so far."""
    if not RESULTS.exists():
        return []
    with RESULTS.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["seed"] == str(seed)]


def copy_checkout(room: str) -> tuple[Path, dict[str, str]]:
    """Copy the checkout for a room; return the folder and the environment of its tests."""
    sources = sorted((ROOT / "ldcs_ros").rglob("*.py"))
    kernels = b"".join(path.read_bytes() for path in sources if b"@compiled" in path.read_bytes())
    cached = f"kernels-{hashlib.sha256(kernels).hexdigest()[:16]}"
    # One folder for all rooms and runs: kernels are compiled once.
    checkout = RESULTS.parent / "mutants"
    for old in checkout.iterdir() if checkout.exists() else ():
        if old.name != cached:
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    unused = shutil.ignore_patterns(".git", ".venv", "out", "build", ".*_cache", "kernels-*", "__pycache__")
    shutil.copytree(ROOT, checkout, ignore=unused, dirs_exist_ok=True)
    mode = ROOMS[room].mode
    environment = {
        **os.environ,
        "PYTHONPATH": f"{checkout}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        mode: str(checkout / cached) if mode == COMPILED else "1",
    }
    return checkout, environment


def is_explained(row: dict[str, str]) -> bool:
    """Return whether the page says why a survivor changes no result: a line names its file and its new line."""
    file = Path(row["place"].rpartition(":")[0]).name
    lines = TABLE.sub("", PAGE.read_text(encoding="utf-8")).splitlines()
    return any(file in line and f"`{row['added']}`" in line for line in lines)


def table(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of the rooms and the list of the survivors that the page does not explain, in Markdown."""
    lines = [
        "| room | tried | caught at first | by the time limit | by later tests | no other result | caught [%] |",
        "|---|---|---|---|---|---|---|",
    ]
    equal = [row for row in rows if row["verdict"] == SURVIVED and is_explained(row)]
    for name in [*ROOMS, "all"]:
        mine = [row for row in rows if name in ("all", row["room"])]
        verdicts = [row["verdict"] for row in mine]
        if mine:
            tried, later, same = len(mine), verdicts.count(LATER), sum(row in equal for row in mine)
            caught = tried - verdicts.count(SURVIVED)
            lines.append(
                f"| {name} | {tried} | {caught - later} | {verdicts.count(STOPPED)} | {later} | {same} "
                f"| {100 * caught / max(tried - same, 1):.0f} |"
            )
    lines += ["", "Survivors that nothing explains:", ""]
    left = [row for row in rows if row["verdict"] == SURVIVED and row not in equal]
    lines += [f"- {row['place']}: `{row['removed']}` -> `{row['added']}`" for row in left]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Try the sample of each room; exit status 0 if enough of the changes are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", default=list(ROOMS), help=f"rooms out of {list(ROOMS)}")
    parser.add_argument("--count", type=int, default=43, help="changes of each room")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    parser.add_argument("--again", action="store_true", help="try the survivors in out/mutants.csv again")
    parser.add_argument("--write", action="store_true", help="put the table into docs/mutation.md")
    parser.add_argument("--inside", action="store_true", help="try the changes in the folder here, a copy")
    arguments = parser.parse_args()
    for room in arguments.rooms:
        if arguments.inside:
            try_room(room, arguments.seed, arguments.count, again=arguments.again)
            return 0
        checkout, environment = copy_checkout(room)
        options = [argument for argument in sys.argv[1:] if argument not in arguments.rooms]
        command = [sys.executable, __file__, room, "--inside", *options]
        subprocess.run(command, cwd=checkout, env=environment, check=True)
        print(table([row for row in read_rows(arguments.seed) if row["room"] == room]), flush=True)
    rows = read_rows(arguments.seed)
    if arguments.write:
        PAGE.write_text(TABLE.sub(lambda _: table(rows), PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(table(rows))
    missed = sum(row["verdict"] == SURVIVED and not is_explained(row) for row in rows)
    return 0 if missed <= (1.0 - ASKED) * len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())

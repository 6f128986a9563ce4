"""Mutation testing of the inner rooms with cosmic-ray: a seeded sample of changes, each against the tests that run it.

`make mutants`: each room is changed in a copy of the checkout; status 1 if fewer than the asked fraction of the changes
is caught. Coverage of each test decides which tests a change meets, the fastest first, until the first failure. Each
verdict is a line of out/mutants.csv: a stopped run goes on with the next room. `--again` tries the survivors in
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
import random
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
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
answer = connection.recv(1)
print(answer or "no answer")
sys.exit((answer or bytes([1]))[0])
"""
LIBRARIES = (
    "numpy.testing", "scipy.linalg", "scipy.sparse.linalg", "scipy.integrate", "scipy.interpolate", "scipy.optimize",
    "scipy.spatial", "hypothesis", "matplotlib.figure", "rosbags.rosbag2", "rosbags.typesys", "yaml", "threadpoolctl",
    "pytest_timeout", "_pytest.assertion.rewrite",
)  # fmt: skip
# A change meets at least so many tests, and more up to a processor time [s].
MIN_TESTS, BUDGET = 8, 6.0
# Limits of a change: its processor time [s], which a loaded machine does not shorten, and its time [s].
LIMIT, LONGEST = 30, 600.0
RESULTS = ROOT / "out" / "mutants.csv"
COLUMNS = ("seed", "room", "place", "operator", "occurrence", "removed", "added", "verdict")
CAUGHT, STOPPED, LATER, SURVIVED = "caught", "stopped", "caught later", "survived"
TABLE = re.compile(r"(?<=<!-- figures -->\n).*?(?=<!-- end of figures -->)", re.DOTALL)


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
    "signals": Room(50, ("test/signals",), compiled=False),
    "twin": Room(50, ("test/twin",), compiled=False),
    # Those of its tests that are short without compiled kernels.
    "physics": Room(
        52,
        (
            "test/physics/test_any_surface.py",
            "-k",
            "not (at_rest_bends or opposite_dir or rotated_sheet or each_arm or keeps_its_mom or columns_beside)",
            "test/physics/test_arm_mechanics.py",
            "test/physics/test_documented_parameters.py",
            "test/physics/test_effects_consistent.py",
            "test/physics/test_lattice_and_points.py",
            "test/physics/test_magnitudes.py",
            "test/physics/test_spring_laws.py",
            "test/physics/test_total_force.py",
        ),
        compiled=False,
    ),
    "simulation": Room(50, ("test/simulation",), compiled=True),
    # Not the tests with processes, wires and clocks: on a busy machine their limits of time would count as a catch;
    # nor those from end to end, which take minutes without compiled kernels.
    "rig": Room(
        50,
        (
            "test/rig",
            "--ignore=test/rig/test_attacks.py",
            "--ignore=test/rig/test_bridge_and_rig_as_processes.py",
            "--ignore=test/rig/test_output_process.py",
            "--ignore=test/rig/test_an_odd_surface_goes_all_the_way.py",
            "--ignore=test/rig/test_from_shadow_run_to_identified_rig.py",
            "-k",
            "not modbus and not serial and not comes_back",
        ),
        compiled=True,
    ),
    "integrators": Room(50, ("test/integrators",), compiled=True),
}


def sample(
    items: Sequence[WorkItem], checkout: Path, count: int, seed: int, *, kernels: bool
) -> list[WorkItem]:
    """Return one change at each of `count` places; a place is one operator or constant of the source.

    Without `kernels` compiled functions are left out: each change of one costs a minute of compilation.
    """
    places: dict[tuple[str, tuple[int, int]], list[WorkItem]] = {}
    for item in items:
        mutation = item.mutations[0]
        source = (checkout / mutation.module_path).read_text(encoding="utf-8")
        number = mutation.start_pos[0]
        if (
            not EXCLUDED.search(mutation.operator_name)
            and not MISUSE.search(source.splitlines()[number - 1])
            and (kernels or not is_compiled(source, number))
        ):
            places.setdefault((str(mutation.module_path), mutation.start_pos), []).append(item)
    draw = random.Random(seed)

    def kind(item: WorkItem) -> tuple[str, int]:
        return item.mutations[0].operator_name, item.mutations[0].occurrence

    chosen: list[WorkItem] = []
    for place in draw.sample(sorted(places), len(places)):
        item = draw.choice(sorted(places[place], key=kind))
        if len(chosen) < count and tells(item, checkout):
            chosen.append(item)
    return sorted(chosen, key=lambda item: (str(item.mutations[0].module_path), item.mutations[0].start_pos))


def tells(item: WorkItem, checkout: Path) -> bool:
    """Return whether a change is Python, and changes a number by more than 0.1 %, which no tolerance would hide."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    mutation = item.mutations[0]
    source = (checkout / mutation.module_path).read_text(encoding="utf-8")
    operator = get_operator(mutation.operator_name)(**mutation.operator_args)
    after = mutate_code(source, operator, mutation.occurrence)
    if after is None:
        return False
    try:
        trees = [ast.walk(ast.parse(text)) for text in (source, after)]
    except SyntaxError:
        return False
    numbers = [
        [
            node.value
            for node in nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, (int, float))
        ]
        for nodes in trees
    ]
    differing = [(a, b) for a, b in zip(*numbers, strict=False) if a != b]
    return len(differing) != 1 or abs(differing[0][1] - differing[0][0]) > 1e-3 * abs(differing[0][0])


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


def measure_tests(name: str, checkout: Path) -> None:
    """Run a room's tests without a change; write which test runs which line, and their durations, into tests.json.

    The figures are kept for the next run on the same sources and tests.
    """
    from coverage import CoverageData

    files = sorted(
        file for folder in (f"ldcs_ros/{name}", f"test/{name}") for file in (checkout / folder).rglob("*.py")
    )
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    kept = RESULTS.parent / f"mutants-{name}-{digest}.json"
    if kept.exists():
        shutil.copy(kept, checkout / "tests.json")
        return

    durations = Durations()
    options = [f"--cov=ldcs_ros.{name}", "--cov-context=test", "--cov-report=", "--cov-fail-under=0"]
    status = pytest.main(
        ["-q", "-p", "no:cacheprovider", "--timeout=600", *options, *ROOMS[name].tests], plugins=[durations]
    )
    if status != 0:
        raise SystemExit(f"the tests of {name} fail without a change")
    data = CoverageData(str(checkout / ".coverage"))
    data.read()
    lines = {
        str(Path(file).relative_to(checkout)): {
            line: sorted({context.partition("|")[0] for context in contexts} & set(durations.of))
            for line, contexts in data.contexts_by_lineno(file).items()
        }
        for file in data.measured_files()
    }
    kept.parent.mkdir(exist_ok=True)
    kept.write_text(json.dumps({"lines": lines, "durations": durations.of}), encoding="utf-8")
    shutil.copy(kept, checkout / "tests.json")


def serve(room: str) -> None:
    """Run the tests of the present change for each connection, in a fork that has all libraries already.

    The answer is one byte, 0 for tests that pass; none for tests that end the process or take too long.
    """
    for library in (*LIBRARIES, *(["numba"] if ROOMS[room].compiled else [])):
        with contextlib.suppress(ImportError):
            import_module(library)
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # they take longer than most of these tests
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("tests.sock")
        server.listen()
        while True:
            connection, _ = server.accept()
            child = os.fork()
            if child == 0:
                os.setsid()
                resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
                tests = tests_of_the_change(room)
                # A change that no test runs survives.
                options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "pytest_timeout", "--timeout=0"]
                status = pytest.main([*options, *tests]) if tests else 0
                connection.sendall(bytes([min(int(status), 255)]))
                os._exit(0)
            deadline = time.monotonic() + LONGEST
            while os.waitpid(child, os.WNOHANG) == (0, 0):
                if time.monotonic() > deadline:
                    os.kill(child, signal.SIGKILL)
                time.sleep(0.01)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)  # processes that its tests left
            connection.close()


def changed_file(room: str) -> Path:
    """Return the path of the file that the checkout here has changed."""
    for path in sorted(Path("ldcs_ros", room).rglob("*.py")):
        if path.read_bytes() != (Path("unchanged") / path).read_bytes():
            return path
    raise SystemExit("no change in this checkout")


def tests_of_the_change(room: str) -> list[str]:
    """Return the tests that run the changed lines of the checkout here, the fastest first."""
    known = json.loads(Path("tests.json").read_text(encoding="utf-8"))
    path = changed_file(room)
    before, after = (
        (folder / path).read_text(encoding="utf-8").splitlines() for folder in (Path("unchanged"), Path())
    )
    lines = known["lines"].get(str(path), {})
    numbers = [k for k, (a, b) in enumerate(zip_longest(before, after), start=1) if a != b]
    found = {test for number in numbers for test in lines.get(str(number), [])}
    if not found:
        # Run at import, in another process, or only compiled: the tests of the file, or of the room.
        found = {test for tests in lines.values() for test in tests} or set(known["durations"])
    chosen, spent = [], 0.0
    for test in sorted(found, key=lambda test: known["durations"][test]):
        spent += known["durations"][test]
        if spent > (BUDGET if len(chosen) >= MIN_TESTS else LIMIT / 3.0):
            break
        chosen.append(test)
    return chosen


@cache
def is_compiled(source: str, line: int) -> bool:
    """Return whether a line is inside a compiled function."""
    return any(
        node.lineno <= line <= (node.end_lineno or 0)
        and any("compiled" in ast.unparse(decorator) for decorator in node.decorator_list)
        for node in ast.parse(source).body
        if isinstance(node, ast.FunctionDef)
    )


def try_changes(
    name: str, seed: int, count: int, survivors: set[tuple[str, ...]] | None
) -> list[dict[str, str]]:
    """Try a sample of a room's changes, or its former survivors, in a copy; return a row for each."""
    from cosmic_ray.work_db import WorkDB, use_db
    from cosmic_ray.work_item import TestOutcome

    room = ROOMS[name]
    # One folder for all rooms and runs: kernels are compiled once.
    checkout = RESULTS.parent / "mutants"
    for old in checkout.iterdir() if checkout.exists() else ():
        if old.name != "kernels":
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    unused = shutil.ignore_patterns(".git", ".venv", "out", "build", ".*_cache", "kernels-*")
    shutil.copytree(ROOT, checkout, ignore=unused, dirs_exist_ok=True)
    shutil.copytree(checkout / "ldcs_ros" / name, checkout / "unchanged" / "ldcs_ros" / name)
    environment = {
        **os.environ,
        "PYTHONPATH": f"{checkout}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        # One cache for all changes.
        **({"NUMBA_CACHE_DIR": str(checkout / "kernels")} if room.compiled else {"LDCS_NO_NUMBA": "1"}),
    }

    def run(*command: str, check: bool = True) -> None:
        subprocess.run([sys.executable, *command], cwd=checkout, env=environment, check=check)

    if room.compiled:
        # Durations must not hold the compilation of kernels, or a change would meet few tests.
        run("-m", "pytest", "-q", "-p", "no:cacheprovider", *room.tests, check=False)
    run(__file__, "--measure", name)
    # A cached module would hide a change within the same second and of the same length.
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    (checkout / "client.py").write_text(CLIENT, encoding="utf-8")
    (checkout / "session.toml").write_text(
        f'[cosmic-ray]\nmodule-path = "ldcs_ros/{name}"\ntimeout = {LONGEST + 30.0}\n'
        f"excluded-modules = {EXCLUDED_FILES}\n"
        f'test-command = "{sys.executable} -I client.py"\n[cosmic-ray.distributor]\nname = "local"\n',
        encoding="utf-8",
    )
    session = ["session.toml", "session.sqlite"]
    run("-m", "cosmic_ray.cli", "init", *session)
    with use_db(checkout / session[1], WorkDB.Mode.open) as database:
        items = list(database.work_items)
        if survivors is None:
            chosen = sample(items, checkout, count, seed, kernels=not room.compiled)
        else:
            chosen = [item for item in items if _key(item) in survivors]
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
        run("-m", "cosmic_ray.cli", "exec", *session, check=False)
    finally:
        server.kill()
        server.wait()
    with use_db(checkout / session[1], WorkDB.Mode.open) as database:
        results = dict(database.results)
    rows = []
    for item in chosen:
        result = results.get(item.job_id)
        if result is None:
            continue  # cosmic-ray was stopped
        verdict = CAUGHT
        if result.test_outcome == TestOutcome.SURVIVED:
            verdict = SURVIVED
        elif "no answer" in (result.output or ""):
            verdict = STOPPED
        removed, added = _change(result.diff or "")
        place, operator, occurrence = _key(item)
        row = (str(seed), name, place, operator, occurrence, removed, added, verdict)
        rows.append(dict(zip(COLUMNS, row, strict=True)))
    return rows


def _key(item: WorkItem) -> tuple[str, str, str]:
    """Return the place, the operator and its occurrence."""
    mutation = item.mutations[0]
    return f"{mutation.module_path}:{mutation.start_pos[0]}", mutation.operator_name, str(mutation.occurrence)


def _change(diff: str) -> tuple[str, str]:
    """Return the first line that a change removes, and the first that it adds."""
    removed, added = (
        next((line[1:].strip() for line in diff.splitlines() if re.match(rf"\{sign}(?!\{sign})", line)), "")
        for sign in "-+"
    )
    return removed, added


def table(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of the rooms and the list of the survivors, in Markdown."""
    lines = [
        "| room | tried | caught | of these by a crash or the time limit | caught [%] | caught with later tests [%] |",
        "|---|---|---|---|---|---|",
    ]
    for name in [*ROOMS, "all"]:
        verdicts = [row["verdict"] for row in rows if name in ("all", row["room"])]
        if verdicts:
            tried, survived, later = len(verdicts), verdicts.count(SURVIVED), verdicts.count(LATER)
            caught = tried - survived - later
            lines.append(
                f"| {name} | {tried} | {caught} | {verdicts.count(STOPPED)} | {100 * caught / tried:.0f} "
                f"| {100 * (caught + later) / tried:.0f} |"
            )
    lines += ["", "Survivors:", ""]
    lines += [
        f"- {row['place']}: `{row['removed']}` -> `{row['added']}`"
        for row in rows
        if row["verdict"] == SURVIVED
    ]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Try the sample of each room; exit status 0 if enough of the changes are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", default=list(ROOMS), help=f"rooms out of {list(ROOMS)}")
    parser.add_argument("--count", type=int, help="changes of each room; a number for each room if not given")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    parser.add_argument("--caught", type=float, default=0.9, help="fraction that must be caught")
    parser.add_argument("--again", action="store_true", help="try the survivors in out/mutants.csv again")
    parser.add_argument("--write", action="store_true", help="put the table into docs/mutation.md")
    parser.add_argument(
        "--measure", metavar="ROOM", help="only measure the tests of the room in the folder here"
    )
    parser.add_argument(
        "--serve", metavar="ROOM", help="only serve the tests of the changes in the folder here"
    )
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments.serve)
    if arguments.measure:
        measure_tests(arguments.measure, Path.cwd())
        return 0
    rows: list[dict[str, str]] = []
    if RESULTS.exists():
        with RESULTS.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["seed"] == str(arguments.seed)]
    for name in arguments.rooms:
        before = [row for row in rows if row["room"] == name]
        left = {
            (row["place"], row["operator"], row["occurrence"]) for row in before if row["verdict"] == SURVIVED
        }
        if before and not (arguments.again and left):
            continue
        count = arguments.count or ROOMS[name].count
        tried = try_changes(name, arguments.seed, count, left if before else None)
        for row in tried if before else ():
            row["verdict"] = SURVIVED if row["verdict"] == SURVIVED else LATER
        new = {(row["place"], row["operator"], row["occurrence"]): row for row in [*before, *tried]}
        rows = [row for row in rows if row["room"] != name] + list(new.values())
        RESULTS.parent.mkdir(exist_ok=True)
        with RESULTS.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
        print(table([row for row in rows if row["room"] == name]), flush=True)
    if arguments.write:
        page = ROOT / "docs" / "mutation.md"
        page.write_text(TABLE.sub(lambda _: table(rows), page.read_text(encoding="utf-8")), encoding="utf-8")
    print(table(rows))
    caught = sum(row["verdict"] != SURVIVED for row in rows)
    return 0 if caught >= arguments.caught * len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())

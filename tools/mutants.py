"""Changes operators and constants of the inner rooms one at a time and lists the changes that no test notices.

`make mutants`: a sample of mutants, drawn with a seed, each in a copy of the package; the tests of a mutant's own
room must fail. Status 1 if fewer than the asked fraction is caught.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Room -> the tests that must notice a change there.
TESTS = {
    "physics": ["test/physics"],
    "integrators": ["test/integrators", "test/simulation"],
    "simulation": ["test/simulation"],
    "twin": ["test/twin"],
    "rig": ["test/rig"],
    "signals": ["test/signals"],
    "schema": ["test/schema", "test/scene"],
    "sensors": ["test/sensors"],
}
OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip


def sites(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Yield each node that can be changed, with the kind of the change; annotations and texts are left alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            yield node, "operator"
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
            yield node, "comparison"
        elif isinstance(node, ast.BoolOp):
            yield node, "logic"
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value != 0:
            yield node, "constant"


def change(node: ast.AST, kind: str) -> None:
    """Change a node in place: swap its operator, or make its constant 1.2 times larger (a whole one by 1)."""
    if kind == "constant" and isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        node.value = node.value + 1 if isinstance(node.value, int) else 1.2 * node.value
    elif isinstance(node, ast.Compare):
        node.ops = [OPERATORS[type(node.ops[0])]()]  # type: ignore[list-item]
    elif isinstance(node, (ast.BinOp, ast.BoolOp)):
        node.op = OPERATORS[type(node.op)]()  # type: ignore[assignment]


def all_mutants(rooms: list[str]) -> list[tuple[Path, int]]:
    """Return every mutant as a file and the number of its site in it."""
    found = []
    for room in rooms:
        for path in sorted((ROOT / "ldcs_ros" / room).rglob("*.py")):
            count = sum(1 for _ in sites(ast.parse(path.read_text(encoding="utf-8"))))
            found += [(path, number) for number in range(count)]
    return found


def survives(path: Path, number: int, copy: Path, timeout: float) -> tuple[bool, str]:
    """Return whether the tests pass with one change in the copy, and the changed line in words."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    node, kind = list(sites(tree))[number]
    before = ast.unparse(node)
    change(node, kind)
    where = path.relative_to(ROOT)
    words = f"{where}:{getattr(node, 'lineno', 0)}: {before} -> {ast.unparse(node)}"
    target = copy / where
    target.write_text(ast.unparse(tree), encoding="utf-8")
    try:
        return passes(where.parts[1], copy, timeout), words
    finally:
        target.write_text(source, encoding="utf-8")


def passes(room: str, copy: Path, timeout: float) -> bool:
    """Return whether the tests of a room pass in the copy; tests that never end do not."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *TESTS[room]]
    # The copy is found before the installed package; kernels are compiled for it alone.
    environment = {**os.environ, "PYTHONPATH": str(copy), "NUMBA_CACHE_DIR": str(copy / "kernels")}
    try:
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=timeout)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def main() -> int:
    """Try a sample of mutants; exit status 0 if enough of them are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", default=list(TESTS), help=f"rooms out of {list(TESTS)}")
    parser.add_argument("--count", type=int, default=300, help="mutants to try")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    parser.add_argument("--caught", type=float, default=0.9, help="fraction that must be caught")
    parser.add_argument(
        "--timeout", type=float, default=600.0, help="longest run of the tests of one mutant [s]"
    )
    arguments = parser.parse_args()
    mutants = all_mutants(arguments.rooms)
    sample = random.Random(arguments.seed).sample(mutants, min(arguments.count, len(mutants)))
    alive = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(
            ROOT,
            copy,
            ignore=shutil.ignore_patterns(".git", ".venv", "out", "build", "__pycache__", ".*_cache"),
        )
        for room in sorted({path.relative_to(ROOT).parts[1] for path, _ in sample}):
            if not passes(room, copy, arguments.timeout):
                print(f"the tests of {room} fail without any change; repair them first", file=sys.stderr)
                return 2
        for index, (path, number) in enumerate(sample, start=1):
            lives, words = survives(path, number, copy, arguments.timeout)
            print(f"{index}/{len(sample)} {'SURVIVED' if lives else 'caught'} {words}", flush=True)
            alive += [words] if lives else []
    caught = 1.0 - len(alive) / len(sample)
    print(
        f"{len(sample)} of {len(mutants)} mutants: {100.0 * caught:.0f} % caught",
        *alive,
        sep="\n  survived: ",
    )
    return 0 if caught >= arguments.caught else 1


if __name__ == "__main__":
    sys.exit(main())

"""The changes that mutation testing tries: a seeded sample of the operators and constants of a room, by cosmic-ray."""

from __future__ import annotations

import ast
import random
import re
from dataclasses import dataclass
from pathlib import Path

# Left out: unions of types, identity of numbers, operators that no float has, and decorators: `compiled` changes no
# result. The switch between compiled and plain kernels changes no result either.
EXCLUDED_FILES = ("ldcs_ros/physics/compiled.py",)
EXCLUDED = re.compile(r"BitOr|BitAnd|BitXor|Shift|RemoveDecorator|Comparison.*_(Is|IsNot)$")
# Also left out: switches that only detect misuse, and imports for types.
SKIPPED = re.compile(r"frozen=|strict=|TYPE_CHECKING")
# How kernels run: compiled, with a cache for all changes; as the plain Python that an installation without numba runs;
# or the same code as the compiled one, executed by Python.
COMPILED, PLAIN, EXECUTED = "NUMBA_CACHE_DIR", "LDCS_NO_NUMBA", "NUMBA_DISABLE_JIT"


@dataclass(frozen=True)
class Room:
    """Files to change, with their tests.

    Attributes:
        tests: Arguments of pytest.
        mode: How kernels run. With COMPILED no kernel is changed, for each change would cost a minute of compilation;
            with EXECUTED kernels and physics/kernels alone.
        folders: Below ldcs_ros.
    """

    tests: tuple[str, ...]
    mode: str
    folders: tuple[str, ...]


ROOMS = {
    "signals": Room(("test/signals",), PLAIN, ("signals",)),
    "twin": Room(("test/twin",), PLAIN, ("twin",)),
    # Those of its tests that are short without compiled kernels.
    "physics": Room(
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
        ),
        PLAIN,
        ("physics",),
    ),
    "simulation": Room(("test/simulation",), COMPILED, ("simulation",)),
    # Not the tests with processes, wires and clocks: on a busy machine their limits of time would count as a catch;
    # nor those from end to end, which take minutes without compiled kernels.
    "rig": Room(
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
        COMPILED,
        ("rig",),
    ),
    "integrators": Room(
        ("test/integrators", "test/simulation/test_run_gradient.py"), COMPILED, ("integrators",)
    ),
    "kernels": Room(
        (
            "test/integrators/kernel_vectors.py",
            "test/integrators/kernel_steps.py",
            "test/integrators/kernel_commands.py",
            "test/physics/test_total_force.py",
        ),
        EXECUTED,
        ("integrators", "physics/kernels"),
    ),
}


@dataclass(frozen=True)
class Change:
    """One operator or constant that is replaced: an occurrence of an operator of cosmic-ray in a file.

    Attributes:
        place: File and line, with a colon between.
        operator: Its name in cosmic-ray.
        occurrence: Number among all places in the file that the operator can change.
    """

    place: str
    operator: str
    occurrence: int

    @property
    def path(self) -> Path:
        """File below the checkout."""
        return Path(self.place.rpartition(":")[0])

    @property
    def line(self) -> int:
        """Number of the line, from 1 on."""
        return int(self.place.rpartition(":")[2])

    def changed(self, source: str) -> str | None:
        """Return the changed source; None if there is none."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        changed = mutate_code(source, get_operator(self.operator)(), self.occurrence)
        return None if changed is None else str(changed)


def sample(room: str, seed: int, count: int) -> list[Change]:
    """Return one change at each of `count` places of the checkout here; a place is one operator or constant."""
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    operators = {
        name: get_operator(name)()
        for name in sorted(operator_names())
        if not EXCLUDED.search(name) and not get_operator(name).arguments()
    }
    places: dict[tuple[str, tuple[int, int]], list[Change]] = {}
    folders = [Path("ldcs_ros", folder) for folder in ROOMS[room].folders]
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        nodes, tried = list(ast_nodes(get_ast_from_path(path))), tried_lines(room, path)
        for name, operator in operators.items():
            positions = (start for node in nodes for start, _ in operator.mutation_positions(node))
            for occurrence, start in enumerate(positions):
                if start[0] in tried:
                    change = Change(f"{path}:{start[0]}", name, occurrence)
                    places.setdefault((str(path), start), []).append(change)
    draw = random.Random(seed)
    chosen: list[Change] = []
    for place in draw.sample(sorted(places), len(places)):
        change = draw.choice(places[place])
        if len(chosen) < count and tells(change):
            chosen.append(change)
    return sorted(chosen, key=lambda change: (str(change.path), change.line))


def tried_lines(room: str, path: Path) -> set[int]:
    """Return the lines of a file that a room changes: those of kernels, all others, or both."""
    source, mode = path.read_text(encoding="utf-8"), ROOMS[room].mode
    numbers = {k for k, text in enumerate(source.splitlines(), start=1) if not SKIPPED.search(text)}
    if str(path) in EXCLUDED_FILES:
        return set()
    if "kernels" in path.parts:
        return numbers if mode == EXECUTED else set()
    if mode == PLAIN:
        return numbers
    body = ast.parse(source).body
    compiled = [
        isinstance(node, ast.FunctionDef)
        and any("compiled" in ast.unparse(decorator) for decorator in node.decorator_list)
        for node in body
    ]
    kernels: set[int] = set()
    for node, kernel in zip(body, compiled, strict=True):
        # A kernel, or a constant that one may read.
        if kernel or (any(compiled) and not isinstance(node, (ast.FunctionDef, ast.ClassDef))):
            kernels.update(range(node.lineno, (node.end_lineno or 0) + 1))
    return numbers & kernels if mode == EXECUTED else numbers - kernels


def tells(change: Change) -> bool:
    """Return whether a change is Python, and changes a number by more than 0.1 %, which no tolerance would hide."""
    source = change.path.read_text(encoding="utf-8")
    after = change.changed(source)
    try:
        trees = [ast.walk(ast.parse(text)) for text in (source, after or "not Python")]
    except SyntaxError:
        return False
    before, later = (
        [
            node.value
            for node in nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, (int, float))
        ]
        for nodes in trees
    )
    changed = [(a, b) for a, b in zip(before, later, strict=False) if a != b]
    return len(changed) != 1 or abs(changed[0][1] - changed[0][0]) > 1e-3 * abs(changed[0][0])

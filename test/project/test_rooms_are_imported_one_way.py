"""Rooms import downwards only, lazy imports and those for types included, and keep their private names."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ldcs_ros"

# A room imports rooms above its own line only. This is the one declaration of the order.
ORDER = (
    "errors",
    "extras",
    "schema",
    "tables",
    "sensors",
    "bags",
    "physics",
    "integrators",
    "simulation",
    "scene",
    "reach",
    "messages",
    "twin",
    "signals",
    "replay",
    "compare",
    "identify",
    "estimate",
    "rig",
    "mock_rig",
    "plotting",
    "viewing",
    "validate",
    "learning",
    "study",
    "sweep",
    "ros",
    "cli",
    "__main__",
)
# The package's own file offers Scene and Simulation, and loads them at their first use.
FACADE = "ldcs_ros"
OF_ROS = {"rclpy", "launch", "ldcs_msgs", "sensor_msgs", "geometry_msgs", "std_msgs", "std_srvs"}


def modules() -> dict[str, ast.Module]:
    """Return the syntax tree of every module of the package by its dotted name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


MODULES = modules()


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the modules of this package that a module imports anywhere in its code."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == FACADE:
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                yield submodule if submodule in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == FACADE)


def room(module: str) -> str:
    """Return the room of a module; '' for the package's own file."""
    return module.split(".")[1] if "." in module else ""


def test_every_room_has_a_place_in_the_order():
    rooms = {room(name) for name in MODULES} - {"", "launch"}
    assert rooms == set(ORDER)


def test_no_module_imports_a_room_below_its_own():
    against = [
        f"{name} imports {other}"
        for name, tree in MODULES.items()
        if room(name) in ORDER
        for other in imported(tree)
        if room(other) and ORDER.index(room(other)) > ORDER.index(room(name))
    ]
    assert against == []


def test_no_import_circle_exists_even_with_lazy_imports():
    graph = {name: set(imported(tree)) - {name} for name, tree in MODULES.items() if name != FACADE}
    state: dict[str, int] = {}

    def visit(name: str, above: list[str]) -> None:
        state[name] = 1
        for other in sorted(graph.get(name, ())):
            assert state.get(other) != 1, f"circle: {[*above[above.index(other) :], other]}"
            if other not in state:
                visit(other, [*above, other])
        state[name] = 2

    for name in graph:
        if name not in state:
            visit(name, [name])


def test_only_the_room_of_ros_imports_packages_of_ros():
    importers = {
        room(name)
        for name, tree in MODULES.items()
        for node in ast.walk(tree)
        for module in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
        if module.split(".")[0] in OF_ROS
    }
    assert importers <= {"ros", "launch"}


def test_no_module_imports_a_private_name_of_another_module():
    private = [
        f"{name}: {alias.name} of {node.module}"
        for name, tree in MODULES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == FACADE
        for alias in node.names
        if alias.name.startswith("_") and not alias.name.startswith("__")
    ]
    assert private == []


@pytest.mark.parametrize("lower", ["physics", "integrators", "simulation"])
def test_the_core_reads_no_file_and_knows_no_messages(lower):
    heard = {other for name, tree in MODULES.items() if room(name) == lower for other in imported(tree)}
    assert {room(other) for other in heard} <= set(ORDER[: ORDER.index(lower) + 1])


def test_the_core_loads_neither_ros_nor_bag_nor_plot_libraries():
    program = "import sys, ldcs_ros; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=50
    )
    assert not set(done.stdout.split()) & {"rclpy", "rosbags", "mcap", "mcap_ros2", "matplotlib", "PIL"}

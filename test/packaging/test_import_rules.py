"""Imports between the rooms of the package point one way; the core loads without ROS or bag libraries."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "ldcs_ros"

CORE = {"errors", "schema", "physics", "integrators", "simulation", "scene"}
# Room -> the rooms it may import.
ALLOWED = {
    "errors": set(),
    "schema": {"errors"},
    "physics": {"errors", "schema"},
    "integrators": {"errors", "schema", "physics"},
    "simulation": CORE - {"simulation", "scene"},
    "scene": (CORE - {"scene"}) | {"sensors"},
    "sensors": {"errors", "schema"},
    "bags": {"errors"},
    "messages": CORE | {"sensors", "bags"},
    "twin": CORE | {"sensors", "bags", "messages"},
    "signals": CORE | {"bags", "messages"},
    "plotting": CORE | {"bags", "messages", "signals", "compare"},
    "validate": CORE | {"plotting"},
    "study": CORE | {"plotting"},
    "compare": CORE | {"bags", "signals"},
    "replay": CORE | {"bags", "messages", "twin", "signals"},
    "identify": CORE | {"bags", "messages", "twin", "signals", "replay"},
    "viewing": CORE | {"bags", "messages", "signals", "plotting"},
    "estimate": CORE,
    "rig": CORE | {"sensors", "bags", "messages", "twin", "signals", "estimate"},
    "mock_rig": CORE | {"sensors", "messages", "rig"},
    "cli": CORE
    | {"bags", "messages", "twin", "signals", "plotting"}
    | {"replay", "compare", "validate", "identify", "study", "viewing", "rig"},
    "ros": CORE | {"sensors", "bags", "messages", "twin", "rig", "mock_rig", "viewing"},
    "__main__": {"cli"},
    "__init__": CORE,
}
# Files that ROS loads by themselves are no modules of the package.
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] != "launch")


def room(path: Path) -> str:
    """Return the room that a module is in: the first folder, or the module itself."""
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


def without_type_checking(tree: ast.Module) -> ast.Module:
    """Return the module without its `if TYPE_CHECKING:` blocks, which only a type checker reads."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            node.body = []
    return tree


def imported(path: Path) -> set[str]:
    """Return the absolute names of what a module imports when it runs, wherever in the module."""
    here = ["ldcs_ros", *path.relative_to(PACKAGE).parts[:-1]]
    names: set[str] = set()
    for node in ast.walk(without_type_checking(ast.parse(path.read_text(encoding="utf-8")))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(here[: len(here) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, [base, node.module]))
            names |= {f"{module}.{alias.name}" for alias in node.names}
    return names


def rooms_imported(path: Path) -> set[str]:
    """Return the rooms that a module imports from; a name of the package itself counts as __init__."""
    rooms = set()
    for name in imported(path):
        parts = name.split(".")
        if parts[0] == "ldcs_ros":
            rooms.add(parts[1] if len(parts) > 1 and parts[1] in ALLOWED else "__init__")
    return rooms - {room(path)}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_between_rooms_point_one_way(path: Path) -> None:
    # The package itself exports the core and the version: the rooms that come after the core may use these.
    surface = set() if room(path) in CORE else {"__init__"}
    assert rooms_imported(path) <= ALLOWED[room(path)] | surface


def test_each_module_is_in_a_room_that_the_rules_know() -> None:
    assert {room(path) for path in MODULES} <= set(ALLOWED)


def test_only_the_ros_room_imports_ros() -> None:
    outside = {"rclpy", "launch", "ldcs_msgs", "sensor_msgs", "geometry_msgs", "std_msgs", "std_srvs"}
    for path in MODULES:
        if room(path) != "ros":
            assert not {name.split(".")[0] for name in imported(path)} & outside, path


def test_the_core_loads_neither_ros_nor_bag_nor_plot_libraries() -> None:
    program = "import sys, ldcs_ros; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=50)
    assert not set(done.stdout.split()) & {"rclpy", "rosbags", "mcap", "mcap_ros2", "matplotlib", "PIL"}

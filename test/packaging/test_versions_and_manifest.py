"""The manifests agree with each other and with the code that they describe."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

LOCKS = ("core", "ros", "view", "colcon")
ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ldcs_ros"
DEFINITIONS = sorted((ROOT / "msg_defs").glob("*/*.[ms][sr][gv]"))

# The rosdep key of an import; ROS packages have one name in both.
ROSDEP_KEY = {
    "PIL": "python3-pil",
    "lz4": "mcap-ros2-support",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "mcap_ros2": "mcap-ros2-support",
    "mpl_toolkits": "python3-matplotlib",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "pymodbus": "python3-pymodbus-pip",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
# No rosdep key: a comment of package.xml names them.
FROM_PYPI = {"gymnasium", "pandas", "pyarrow", "threadpoolctl", "xarray"}
# What a wheel is called where its name is neither that of the import nor that of a ROS package.
WHEEL = {
    "PIL": "pillow",
    "mpl_toolkits": "matplotlib",
    "mcap_ros2": "mcap-ros2-support",
    "serial": "pyserial",
    "yaml": "pyyaml",
}
# Skipped at run time where they are not installed, so nothing depends on them.
OPTIONAL = {"launch", "launch_ros", "ldcs_msgs", "simulation_interfaces", "tf2_msgs"}


def imported_packages(folder: Path) -> set[str]:
    """Return the top-level names of the third-party imports of all modules under a folder."""
    names: set[str] = set()
    for module in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.split(".")[0])
    # Type checkers bring _typeshed with them; no module of that name is ever loaded.
    return names - sys.stdlib_module_names - {"ldcs_ros", "_typeshed"}


@pytest.mark.parametrize("manifest", ["package.xml", "msg_defs/package.xml"])
def test_the_manifests_and_the_package_have_one_version(manifest: str) -> None:
    import ldcs_ros

    assert ElementTree.parse(ROOT / manifest).getroot().findtext("version") == ldcs_ros.__version__


def test_the_changelog_has_the_version() -> None:
    import ldcs_ros

    assert f"## {ldcs_ros.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_manifest_names_every_third_party_import() -> None:
    text = (ROOT / "package.xml").read_text(encoding="utf-8")
    named = {element.text for element in ElementTree.fromstring(text).iter("exec_depend")}
    comments = " ".join(re.findall(r"<!--(.*?)-->", text, flags=re.DOTALL))
    missing = set()
    for name in imported_packages(PACKAGE) - OPTIONAL:
        if name in FROM_PYPI:
            if not re.search(rf"\b{name}\b", comments):
                missing.add(name)
        elif ROSDEP_KEY.get(name, name) not in named:
            missing.add(name)
    assert not missing


def test_a_workspace_gets_the_optional_packages_too() -> None:
    """rosdep knows no options: who builds a workspace gets everything that the package can use."""
    tree = ElementTree.parse(ROOT / "package.xml").getroot()
    assert {element.text for element in tree.iter("exec_depend")} >= OPTIONAL


def lock_entries(lock: str) -> list[str]:
    """Return the entries of a lock file, each joined to one line."""
    text = (ROOT / f"requirements/{lock}.lock").read_text(encoding="utf-8")
    joined = re.sub(r"\s*\\\n\s*", " ", text)
    return [line for line in joined.splitlines() if not line.startswith("#")]


def test_no_lock_file_names_a_registry() -> None:
    for lock in LOCKS:
        assert "://" not in (ROOT / f"requirements/{lock}.lock").read_text(encoding="utf-8")


def test_each_installation_from_a_lock_file_demands_its_hashes() -> None:
    for name in ("Makefile", "tools/setup_venv.py", "tools/colcon.sh"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert re.search(r"requirements/\w+\.lock", text)
        assert "--require-hashes" in text, name


def test_every_wheel_that_the_code_imports_is_pinned() -> None:
    """Each entry of the lock files is one exact pin with hashes, so that two set-ups give the same files."""
    pins: set[str] = set()
    for lock in LOCKS:
        for entry in lock_entries(lock):
            pattern = (
                r"([a-z0-9-]+)==[0-9][^ ;]*( ; python_full_version [^\\]*)?( --hash=sha256:[0-9a-f]{64})+"
            )
            match = re.fullmatch(pattern, entry)
            assert match, f"not an exact pin with hashes in {lock}.lock: {entry[:120]}"
            pins.add(match.group(1))
    for name in imported_packages(PACKAGE) - OPTIONAL:
        names = {WHEEL.get(name, name), "ros-" + name.replace("_", "-")}
        assert names & pins, f"{name} is imported but no lock file pins it"


def test_the_interface_package_builds_each_of_its_definitions() -> None:
    text = (ROOT / "msg_defs/CMakeLists.txt").read_text(encoding="utf-8")
    listed = set(re.findall(r'"((?:msg|srv)/\w+\.(?:msg|srv))"', text))
    assert listed == {f"{path.parent.name}/{path.name}" for path in DEFINITIONS}


def test_each_message_field_is_explained() -> None:
    """A field has a comment on its line; the units stand in it."""
    for path in DEFINITIONS:
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.strip() and not line.startswith("#") and line != "---":
                assert re.match(r"[\w/\[\]]+ \w+ +# ?\w|\s+# ?\w", line), f"{path.name}: {line}"

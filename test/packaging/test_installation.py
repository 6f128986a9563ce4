"""An installation, as pip and colcon make it, holds all that the checkout holds."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = ["LICENSE", "package.xml", "pyproject.toml", "setup.cfg", "setup.py"]
FOLDERS = ["resource", "msg_defs", "ldcs_ros"]


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install a copy of the checkout with setup.py, as colcon does, and return the prefix."""
    source, prefix = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("prefix")
    for name in FILES:
        shutil.copy(ROOT / name, source)
    for name in FOLDERS:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=ignored)
    command = [sys.executable, "setup.py", "--quiet", "install", "--prefix", str(prefix)]
    command += ["--single-version-externally-managed", "--record", str(source / "record.txt")]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=50)
    assert done.returncode == 0, done.stderr
    return prefix


def package_folder(prefix: Path) -> Path:
    """Return the folder of the installed Python package under a prefix."""
    return next(path.parent for path in prefix.rglob("ldcs_ros/__init__.py"))


def test_each_module_scene_and_definition_is_installed(installation: Path) -> None:
    wanted = {
        path.relative_to(ROOT / "ldcs_ros")
        for pattern in ("**/*.py", "scenes/*.yaml", "msg_defs/*/*.msg", "msg_defs/*/*.srv")
        for path in (ROOT / "ldcs_ros").glob(pattern)
        if "launch" not in path.parts
    }
    folder = package_folder(installation)
    assert len(wanted) > 10
    assert not [str(path) for path in wanted if not (folder / path).is_file()]


def test_each_launch_and_config_file_is_installed(installation: Path) -> None:
    share = installation / "share/ldcs_ros"
    files = [path for name in ("launch", "config") for path in (ROOT / "ldcs_ros" / name).glob("*.*")]
    assert files
    assert not [path.name for path in files if not (share / path.parent.name / path.name).is_file()]


def test_ros_finds_the_package_and_its_executables(installation: Path) -> None:
    assert (installation / "share/ament_index/resource_index/packages/ldcs_ros").is_file()
    assert (installation / "share/ldcs_ros/package.xml").is_file()
    for name in ("ldcs", "sim"):
        assert os.access(installation / "lib/ldcs_ros" / name, os.X_OK)


def test_each_entry_point_names_a_module_that_is_there(installation: Path) -> None:
    entry_points = ConfigParser()
    entry_points.read(next(installation.rglob("entry_points.txt")))
    scripts = dict(entry_points["console_scripts"])
    assert {"ldcs", "sim"} <= set(scripts)
    for target in scripts.values():
        module, function = target.split(":")
        spec = importlib.util.find_spec(module)
        assert spec and spec.origin and f"def {function}(" in Path(spec.origin).read_text(encoding="utf-8")

"""The wheel in an environment of its own: it holds what it needs, its programs run, and it says what is missing."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PARTS = [
    "LICENSE",
    "package.xml",
    "pyproject.toml",
    "setup.cfg",
    "setup.py",
    "resource",
    "msg_defs",
    "ldcs_ros",
]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(
                ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__")
            )
        else:
            shutil.copy(ROOT / name, source)
    words = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    ]
    done = subprocess.run(
        [*words, "-w", str(folder), str(source)], capture_output=True, text=True, timeout=50
    )
    assert done.returncode == 0, done.stderr
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory) -> Path:
    """Return a fresh virtual environment with the wheel; a path file shows it the dependencies of the tests."""
    folder = tmp_path_factory.mktemp("fresh") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=30)
    words = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(folder / "bin/python"),
        "install",
        "--quiet",
        "--no-deps",
    ]
    done = subprocess.run([*words, "--no-index", str(wheel)], capture_output=True, text=True, timeout=50)
    assert done.returncode == 0, done.stderr
    site = next(folder.glob("lib/python*/site-packages"))
    # The checkout is not on this path: an editable installation adds itself by a hook that a path file does not run.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    return folder


def run(environment: Path, *words: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a program of the environment in its own folder, without anything of the checkout's environment."""
    kept = {
        name: os.environ[name] for name in ("HOME", "LANG", "TMPDIR", "NUMBA_CACHE_DIR") if name in os.environ
    }
    return subprocess.run(
        [str(environment / "bin" / words[0]), *words[1:]],
        cwd=environment,
        env={**kept, "PATH": os.defpath, **variables},
        capture_output=True,
        text=True,
        timeout=50,
    )


def test_the_wheel_holds_scenes_definitions_and_the_license(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    for wanted in ("ldcs_ros/scenes/rig.yaml", "ldcs_ros/py.typed", "ldcs_ros/msg_defs/msg/LatticeState.msg"):
        assert wanted in names
    assert any(name.endswith("LICENSE") for name in names)
    assert not [name for name in names if name.startswith(("test/", "tools/", "bench/"))]


def test_its_command_line_runs_outside_of_the_checkout(environment):
    where = run(environment, "python", "-c", "import ldcs_ros; print(ldcs_ros.__file__)").stdout
    assert str(environment) in where
    done = run(environment, "ldcs", "scenes")
    assert done.returncode == 0 and "paper_calibrated" in done.stdout


def test_each_program_has_a_name_that_clashes_with_no_other(environment):
    for name in ("ldcs-sim", "ldcs-bridge", "ldcs-mock-rig", "ldcs-live-view"):
        assert os.access(environment / "bin" / name, os.X_OK)
        assert "ldcs_ros" in (environment / "bin" / name).read_text()


def test_what_is_missing_is_installed_by_a_command_that_this_user_can_run(environment):
    for words in ("[]", "['--help']"):
        hidden = "import sys; sys.modules['rclpy'] = None; from ldcs_ros.ros.__main__ import sim"
        done = run(environment, "python", "-c", f"{hidden}; sys.exit(sim({words}))")
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "bin/python -m pip install ros-rclpy ros-rmw-fastrtps-cpp" in done.stderr
        assert "make setup" not in done.stderr
    hidden = (
        "import sys; sys.modules['rerun'] = None; from ldcs_ros.viewing.rerun_package import rerun; rerun()"
    )
    error = run(environment, "python", "-c", hidden).stderr
    assert "-m pip install 'rerun-sdk>=0.39'" in error and "make viewer" not in error


def metadata_lines(wheel: Path) -> list[str]:
    with zipfile.ZipFile(wheel) as archive:
        name = next(one for one in archive.namelist() if one.endswith("METADATA"))
        return archive.read(name).decode().splitlines()


def test_the_metadata_name_the_extras_and_the_pythons(wheel):
    lines = metadata_lines(wheel)
    extras = {line.partition(": ")[2] for line in lines if line.startswith("Provides-Extra")}
    assert {"ros", "rig", "view", "data", "rl", "cluster"} <= extras
    pythons = {line.rpartition(" :: ")[2] for line in lines if "Programming Language :: Python :: 3." in line}
    bounds = re.search(
        r"OLDEST, NEWEST = \(3, (\d+)\), \(3, (\d+)\)", (ROOT / "tools/setup_venv.py").read_text()
    )
    assert pythons == {f"3.{minor}" for minor in range(int(bounds[1]), int(bounds[2]) + 1)}
    assert f"Requires-Python: >=3.{bounds[1]}" in lines


def test_the_extra_ros_is_what_the_checkout_runs_the_node_on(wheel):
    found = [
        match[1]
        for line in metadata_lines(wheel)
        if (match := re.match(r'Requires-Dist: (\S+); extra == "ros"', line))
    ]
    runs_on = (ROOT / "requirements/ros.in").read_text().split("# What building")[0].splitlines()
    assert found == [line for line in runs_on if line and not line.startswith("#")]

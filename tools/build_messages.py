"""Builds interface packages and installs them into the venv that runs this script; all, or those named.

Where one cannot be built, one line says why and the exit status is 1; the twin runs without it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "messages"
PACKAGES = {
    "ldcs_msgs": ROOT / "msg_defs",
    # MockRigServer in for packages of the distribution, so that what needs them is tested everywhere.
    "simulation_interfaces": ROOT / "test" / "ros" / "stand_ins" / "simulation_interfaces",
    "tf2_msgs": ROOT / "test" / "ros" / "stand_ins" / "tf2_msgs",
}


def prefixes() -> list[str]:
    """Return the folders that ROS 2 packages are looked for in: the venv, then the sourced distribution."""
    ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return list(dict.fromkeys([sys.prefix, *filter(None, ament)]))


def missing() -> list[str]:
    """Return what this machine lacks to build message packages."""
    lacks = [tool for tool in ("cmake", "g++", "make") if shutil.which(tool) is None]
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        lacks.append("Python.h (Debian, Ubuntu: apt install python3-dev)")
    if not any(Path(prefix, "share/rosidl_default_generators").is_dir() for prefix in prefixes()):
        lacks.append("ROS 2 (rosidl_default_generators)")
    return lacks


def found_elsewhere(package: str) -> bool:
    """Tell whether a sourced distribution or workspace has a package."""
    return any(Path(prefix, "share", package).is_dir() for prefix in prefixes() if prefix != sys.prefix)


def build(package: str) -> bool:
    """Build and install one package; return whether that went well."""
    environment = os.environ | {"AMENT_PREFIX_PATH": os.pathsep.join(prefixes())}
    python_folder = f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    folder = BUILD / package
    commands = [
        [
            "cmake", "-S", str(PACKAGES[package]), "-B", str(folder),
            f"-DCMAKE_INSTALL_PREFIX={sys.prefix}",
            f"-DCMAKE_PREFIX_PATH={';'.join(prefixes())}",
            f"-DPython3_EXECUTABLE={sys.executable}",
            f"-DPYTHON_INSTALL_DIR={python_folder}",
            "-DBUILD_TESTING=OFF",
        ],
        ["cmake", "--build", str(folder), "--parallel", str(os.cpu_count() or 1)],
        ["cmake", "--install", str(folder)],
    ]  # fmt: skip
    shutil.rmtree(folder, ignore_errors=True)  # CMake's cache may name a Python or a message that is gone
    folder.mkdir(parents=True)
    log = folder / "log.txt"
    with log.open("wb") as output:
        for command in commands:
            status = subprocess.call(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
            if status:
                sys.stderr.write("".join(log.read_text(errors="replace").splitlines(keepends=True)[-15:]))
                print(f"setup: {package} is not built (the twin runs without it): see {log}", file=sys.stderr)
                return False
    print(f"setup: built {package}")
    return True


def main(packages: list[str]) -> int:
    """Build interface packages that are not installed; return the exit status."""
    wanted = [name for name in packages if name == "ldcs_msgs" or not found_elsewhere(name)]
    if wanted and (lacks := missing()):
        missing_here = ", ".join(lacks)
        names = ", ".join(wanted)
        print(f"setup: {names} not built (the twin runs without): no {missing_here}", file=sys.stderr)
        return 1
    return 0 if all([build(name) for name in wanted]) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or list(PACKAGES)))

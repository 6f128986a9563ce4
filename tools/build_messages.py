"""Builds the interface package ldcs_msgs (msg_defs/) and installs it into the venv that runs this script.

Where it cannot be built, one line says why and the exit status is 1; the twin runs without it.
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


def main() -> int:
    lacks = missing()
    if lacks:
        missing_here = ", ".join(lacks)
        print(f"setup: ldcs_msgs is not built (the twin runs without it): no {missing_here}", file=sys.stderr)
        return 1
    environment = os.environ | {"AMENT_PREFIX_PATH": os.pathsep.join(prefixes())}
    python_folder = f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    commands = [
        [
            "cmake", "-S", str(ROOT / "msg_defs"), "-B", str(BUILD),
            f"-DCMAKE_INSTALL_PREFIX={sys.prefix}",
            f"-DCMAKE_PREFIX_PATH={';'.join(prefixes())}",
            f"-DPython3_EXECUTABLE={sys.executable}",
            f"-DPYTHON_INSTALL_DIR={python_folder}",
            "-DBUILD_TESTING=OFF",
        ],
        ["cmake", "--build", str(BUILD), "--parallel", str(os.cpu_count() or 1)],
        ["cmake", "--install", str(BUILD)],
    ]  # fmt: skip
    shutil.rmtree(BUILD, ignore_errors=True)  # CMake's cache may name a Python or a message that is gone
    BUILD.mkdir(parents=True)
    log = BUILD / "log.txt"
    with log.open("wb") as output:
        for command in commands:
            status = subprocess.call(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
            if status:
                sys.stderr.write("".join(log.read_text(errors="replace").splitlines(keepends=True)[-15:]))
                print(f"setup: ldcs_msgs is not built (the twin runs without it): see {log}", file=sys.stderr)
                return 1
    print("setup: built ldcs_msgs")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Makes .venv/ of the checkout from the lock files; run by `make setup` with the Python it is made for.

Only the standard library, and syntax that Python 3.6 still parses, so that it can say what is wrong.
"""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
# Tried with CPython 3.10, 3.11, 3.12 and 3.13; for 3.14 every pin has a wheel, but nobody has run it yet.
OLDEST, NEWEST = (3, 10), (3, 14)


def fail(message):
    """End with one clear line."""
    sys.exit("setup: " + message)


def run(*command):
    """Run a command in the checkout; what went wrong stands in its own output."""
    status = subprocess.call([str(part) for part in command], cwd=str(ROOT))
    if status:
        fail(f"'{' '.join(map(str, command))}' failed with exit status {status}")


def check_python():
    """Refuse a Python that the pinned versions do not exist for, or that cannot make a venv."""
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        got, expected = platform.python_version(), "{}.{} to {}.{}".format(*OLDEST, *NEWEST)
        fail(f"{sys.executable} is Python {got}; expected {expected}. Name one: make setup PYTHON=python3.11")
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        fail("this Python has no venv module; install it first (Debian, Ubuntu: apt install python3-venv)")


def distribution():
    """Return the name of the sourced ROS 2 distribution, or None if this Python can use none."""
    name = os.environ.get("ROS_DISTRO")
    if not name:
        return None
    if subprocess.call([sys.executable, "-c", "import rclpy"], stderr=subprocess.DEVNULL):
        print(f"setup: ROS_DISTRO is '{name}', but {sys.executable} cannot import rclpy: using the wheels")
        return None
    return name


def main():
    """Make the virtual environment with the pinned versions."""
    check_python()
    ros = distribution()
    print(f"setup: making .venv with {sys.executable}, ROS 2 {ros or 'from wheels'}", flush=True)
    shutil.rmtree(str(VENV), ignore_errors=True)
    run(sys.executable, "-m", "venv", *(["--system-site-packages"] if ros else []), VENV)

    # The lock files are complete, so nothing is resolved, and a file whose hash they do not list is refused.
    # Sources are built with the pinned setuptools. Python compiles a module at its first import; to compile all of them
    # here, most of which nothing imports, would double the time.
    python = VENV / "bin/python"
    install = [
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--require-hashes",
        "--no-compile",
    ]
    run(*install, "--requirement", "requirements/core.lock")
    if ros is None:
        if platform.machine() == "x86_64":
            run(*install, "--no-build-isolation", "--use-pep517", "--requirement", "requirements/ros.lock")
            run(python, "tools/correct_exports.py")
        else:
            print(f"setup: no ROS 2 wheels for {platform.machine()}: the node needs a ROS 2 distribution")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        fail("stopped; the next make setup starts over")

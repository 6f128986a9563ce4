"""Makes .venv/ of the checkout from the lock files; run by `make setup` with the Python it is made for.

Only the standard library, and syntax that an old Python still parses, so that it can say what is wrong.
"""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
OLDEST, NEWEST = (3, 10), (3, 14)


def fail(message):
    """End with one clear line."""
    sys.exit("setup: " + message)


def run(*command):
    """Run a command in the checkout; what went wrong stands in its own output."""
    status = subprocess.call([str(part) for part in command], cwd=str(ROOT))
    if status:
        fail("'{}' failed with exit status {}".format(" ".join(map(str, command)), status))


def check_python():
    """Refuse a Python that the pinned versions do not exist for, or that cannot make a venv."""
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        fail(
            "{} is Python {}.{}; expected {}.{} to {}.{}. Name one: make setup PYTHON=python3.11".format(
                sys.executable, *sys.version_info[:2], *OLDEST, *NEWEST
            )
        )
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        fail("this Python has no venv module; install it first (Debian, Ubuntu: apt install python3-venv)")


def distribution():
    """Return the name of the sourced ROS 2 distribution, or None if there is none that this Python can use."""
    name = os.environ.get("ROS_DISTRO")
    if not name:
        return None
    if subprocess.call([sys.executable, "-c", "import rclpy"], stderr=subprocess.DEVNULL):
        print("setup: ROS_DISTRO is '{}', but {} cannot import rclpy: using the wheels".format(name, sys.executable))
        return None
    return name


def main():
    check_python()
    ros = distribution()
    print("setup: making .venv with {} ({})".format(sys.executable, "ROS 2 " + ros if ros else "no ROS 2 distribution"))
    shutil.rmtree(str(VENV), ignore_errors=True)
    run(sys.executable, "-m", "venv", *(["--system-site-packages"] if ros else []), VENV)

    # The lock files are complete, so nothing is resolved; sources among them are built with the pinned setuptools.
    install = [VENV / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    run(*install, "--requirement", "requirements/core.lock")
    if ros is None:
        if platform.machine() == "x86_64":
            run(*install, "--no-build-isolation", "--requirement", "requirements/ros.lock")
            run(VENV / "bin/python", "tools/correct_exports.py")
        else:
            print("setup: no ROS 2 wheels for {}: source a ROS 2 distribution for the node".format(platform.machine()))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        fail("stopped; the next make setup starts over")

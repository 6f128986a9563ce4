"""Systems without what Linux has: every module of the core is imported, a run is recorded, and its bag read."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# What Windows (all of it) and macOS (the last two) lack.
HIDE = """
import os, signal, sys
for module in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[module] = None
for name in ("SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGPIPE", "SIGKILL", "pthread_sigmask"):
    if hasattr(signal, name):
        delattr(signal, name)
for name in ("fork", "getuid", "geteuid", "fdatasync", "sched_getaffinity"):
    delattr(os, name)
"""
RUN = """
import importlib, pkgutil
from pathlib import Path
import ldcs_ros
for room in pkgutil.iter_modules(ldcs_ros.__path__):
    if room.name in ("ros", "launch", "__main__"):
        continue
    importlib.import_module(f"ldcs_ros.{room.name}")
    for module in pkgutil.walk_packages([f"{ldcs_ros.__path__[0]}/{room.name}"], f"ldcs_ros.{room.name}."):
        importlib.import_module(module.name)
from ldcs_ros.simulation.threads import core_count
assert core_count() == os.cpu_count()
from ldcs_ros.cli.main import main
assert main(["simulate", "single_spring", "--duration", "0.05", "--bag", sys.argv[1]]) == 0
assert main(["recover", sys.argv[1]]) == 0
from ldcs_ros.bags import read_bag
print("messages", read_bag(sys.argv[1]).count)
"""


def test_the_core_runs_without_what_only_linux_has(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", HIDE + RUN, str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=55,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split("messages")[-1]) >= 10


def test_each_module_is_python_3_10():
    for path in sorted((ROOT / "ldcs_ros").rglob("*.py")):
        ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 10))

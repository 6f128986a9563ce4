"""The checkout: what is tracked fits on any machine, and `make` says what it can do."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# A folder of one person or one machine; written so that this line does not match itself.
MACHINE_PATH = re.compile(rb"(?<![\w.}~-])/(?:home|root|Users|work)" rb"/[\w.]+")


def run(*command: str) -> str:
    """Return what a command run in the checkout prints."""
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=20).stdout


def test_no_tracked_file_names_a_folder_of_one_machine() -> None:
    tracked = [ROOT / name for name in run("git", "ls-files", "-z").split("\0") if name]
    assert tracked
    found = {
        str(path.relative_to(ROOT)): match.group()
        for path in tracked
        if path.is_file() and (match := MACHINE_PATH.search(path.read_bytes()))
    }
    assert not found


def test_make_alone_lists_each_target_on_one_line() -> None:
    listed = [line.split()[1] for line in run("make", "--no-print-directory").splitlines()]
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert phony
    assert listed == phony.group(1).split()


def test_what_set_up_and_runs_make_is_ignored() -> None:
    made = [".venv/x", "build/x", "install/x", "log/x", "out/x", "ldcs_ros/__pycache__/x.pyc"]
    assert run("git", "check-ignore", *made).split() == made


def test_shell_scripts_are_well_formed_and_executable() -> None:
    for script in [*(ROOT / "tools").glob("*.sh"), ROOT / ".ci/run"]:
        run("bash", "-n", str(script))
        assert script.name == "environment.sh" or script.stat().st_mode & 0o100, script

"""The commands of the first hour run in their order, on the scene that the page prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from ldcs_ros.cli.main import main

PAGE = (Path(__file__).resolve().parents[2] / "docs/first_hour.md").read_text(encoding="utf-8")


def test_the_first_hour_runs_as_it_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.yaml").write_text(re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[1])
    commands = re.findall(r"^    (ldcs .*)$", PAGE, re.MULTILINE)
    assert len(commands) >= 7
    for command in commands:
        # A shorter run takes the same way.
        words = shlex.split(
            command.replace("--duration 3", "--duration 0.05").replace("--times 3", "--times 0.05")
        )
        assert main(words[1:]) == 0, command

"""The README keeps its word: its program runs, its tables are what the code has, its pictures are there."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import yaml
from PIL import Image

from ldcs_ros import shipped_scenes
from ldcs_ros.cli.main import VERBS
from ldcs_ros.interface.topics import TOPICS
from ldcs_ros.mapping.load import parse_mapping

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def first_cells(section):
    """Return the first cells of the table in a section, without the head."""
    body = TEXT.split(f"\n## {section}\n")[1].split("\n## ")[0]
    rows = [line for line in body.splitlines() if line.startswith("|")][2:]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows]


def test_the_first_program_is_short_and_runs():
    program = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)[1]
    assert len(program.strip().splitlines()) <= 10
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=55)
    assert done.returncode == 0, done.stderr
    assert re.search(r"P1 stands at \[ *1[0-9]{2}\.\d? .*\] mm", done.stdout), done.stdout


def test_the_scenes_are_those_that_are_shipped():
    assert sorted(row[0] for row in first_cells("Scenes")) == sorted(shipped_scenes())


def test_the_verbs_are_those_of_the_command_line():
    assert [row[0].split()[1] for row in first_cells("The command line")] == list(VERBS)


def test_the_topics_are_those_of_the_twin():
    written = {row[1]: (row[0], row[2]) for row in first_cells("ROS 2")}
    real = {name: (topic.direction, topic.type.replace("/msg/", "/")) for name, topic in TOPICS.items()}
    assert written == real


def test_the_rooms_are_those_of_the_package():
    tree = TEXT.split("    ldcs_ros/\n")[1].split("\n\n")[0]
    named = set(re.findall(r"([a-z]+)/", tree))
    real = {path.name for path in (ROOT / "ldcs_ros").iterdir() if path.is_dir() and not path.is_symlink()}
    assert {name for name in real if name[0] not in "._"} <= named


def test_links_and_pictures_are_there_and_small():
    targets = re.findall(r"\]\(([^)#]+)\)", TEXT)
    assert "docs/images/surface.png" in targets
    for target in targets:
        if "://" not in target:
            assert (ROOT / target).is_file(), target
    for path in (ROOT / "docs" / "images").iterdir():
        assert path.stat().st_size < 300_000, path
        with Image.open(path) as image:
            assert image.width >= 400


def test_the_picture_stands_on_the_first_screen():
    assert TEXT.index("docs/images/surface.png") < 1200 and TEXT.index("make sim") < 1800


def test_the_commands_parse():
    lines = re.findall(r"^    ldcs (.*)$", TEXT, re.MULTILINE)
    assert len(lines) > 2
    for line in lines:
        verb, *words = line.split()
        parser = argparse.ArgumentParser(exit_on_error=False)
        import_module(VERBS[verb].module).add_arguments(parser)
        parser.parse_args(words)


def test_the_mapping_file_is_one():
    block = re.search(r"```yaml\n(.*?)```", TEXT, re.DOTALL)[1]
    mapping = parse_mapping(yaml.safe_load(block))
    assert len(mapping.commands) == 1 and {source.to for source in mapping.measurements} == {
        "P0",
        "P1",
        "left/pressure",
    }

"""README and docs keep their word: the program runs, tables are what the code has, links and pictures are there."""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from PIL import Image

from ldcs_ros import shipped_scenes
from ldcs_ros.cli.main import VERBS
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.signals.mapping import parse_mapping

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def first_cells(page, section=""):
    """Return the cells of the first columns of a page's tables, or of those in a section, without the heads."""
    text = (ROOT / page).read_text(encoding="utf-8")
    body = text.split(f"\n## {section}\n")[1].split("\n## ")[0] if section else text
    rows = [line for line in body.splitlines() if line.startswith("|")][2:]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows]


def anchors(page):
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_first_program_is_short_and_runs():
    program = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)[1]
    assert len(program.strip().splitlines()) <= 10
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=55)
    assert done.returncode == 0, done.stderr
    assert re.search(r"P1 is at \[ *1[0-9]{2}\.\d? .*\] mm", done.stdout), done.stdout


def test_the_scenes_are_those_that_are_shipped():
    assert sorted(row[0] for row in first_cells("docs/scenes.md", "Shipped scenes")) == sorted(
        shipped_scenes()
    )


def test_the_verbs_are_those_of_the_command_line():
    assert [row[0].split()[1] for row in first_cells("docs/command_line.md")] == list(VERBS)


def test_the_topics_are_some_of_the_twins():
    written = {row[1]: (row[0], row[2]) for row in first_cells("docs/ros.md", "Topics")}
    real = {name: (topic.direction, topic.type.replace("/msg/", "/")) for name, topic in TOPICS.items()}
    assert len(written) > 8 and written.items() <= real.items()


def test_the_launch_files_are_those_that_are_shipped():
    named = {row[0] for row in first_cells("docs/ros.md", "Launch files")}
    assert named == {path.name for path in (ROOT / "ldcs_ros/launch").glob("*.launch.py")}


def test_the_steps_of_the_readme_come_in_their_order():
    headings = re.findall(r"^## (.*)$", TEXT, re.MULTILINE)
    assert headings[:4] == ["In Python", "Live", "ROS 2", "A rig beside the twin"]


def test_the_tree_of_the_architecture_page_is_the_package():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    tree = page.split("    ldcs_ros/\n")[1].split("\n\n")[0]
    rooms = set(re.findall(r"^      ([a-z_]+)/ ", tree, re.MULTILINE))
    package = ROOT / "ldcs_ros"
    real = {path.name for path in package.iterdir() if path.is_dir() and not path.is_symlink()}
    assert rooms == {name for name in real if name[0] not in "._"}
    for room, inside in re.findall(r"^      ([a-z_]+)/ .*?\((.*?)\)$", tree, re.MULTILINE):
        for folder in re.findall(r"([a-z_]+)/", inside):
            assert (package / room / folder).is_dir(), f"{room}/{folder}"


def test_the_files_that_the_architecture_page_names_exist():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:ldcs_ros|test|tools|docs)/[\w./]+)`", page)
    assert named
    for path in named:
        assert (ROOT / path).exists(), path


def test_the_functions_that_the_architecture_page_names_exist():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`(\w+(?:\.\w+)?)` in \[(\w+\.py)\]\(\.\./([\w/.]+)\)", page)
    assert len(named) > 5
    for name, shown, path in named:
        text = (ROOT / path).read_text(encoding="utf-8")
        assert Path(path).name == shown
        for part in name.split("."):
            assert re.search(rf"^ *(def|class) {part}\b", text, re.MULTILINE), f"{name} in {path}"


def test_the_readme_is_short():
    prose = [line for line in TEXT.splitlines() if not line.startswith("|")]
    assert len(" ".join(prose).split()) < 800


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        assert other.is_file(), target
        assert not anchor or anchor in anchors(other), target


def test_the_readme_leads_to_every_page():
    targets = {target.partition("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", TEXT)}
    assert {page.relative_to(ROOT).as_posix() for page in PAGES[1:]} <= targets


def test_pictures_are_small():
    assert "](docs/images/paper.png)" in TEXT
    for path in [*(ROOT / "docs/images").iterdir(), *(ROOT / "docs").glob("*.png")]:
        assert path.stat().st_size < 300_000, path
        with Image.open(path) as image:
            assert image.width >= 400


def test_the_picture_stands_on_the_first_screen():
    assert TEXT.index("docs/images/paper.png") < 700 and TEXT.index("make sim") < 1200


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_commands_parse(page):
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = re.findall(r"^    ldcs (.*)$", text, re.MULTILINE)
    assert lines or page.name not in ("README.md", "replay.md")
    for line in lines:
        verb, *words = shlex.split(line, comments=True)
        parser = argparse.ArgumentParser(exit_on_error=False)
        import_module(VERBS[verb].module).add_arguments(parser)
        parser.parse_args(words)


def test_the_mapping_file_is_one():
    page = (ROOT / "docs/replay.md").read_text(encoding="utf-8")
    block = re.search(r"```yaml\n(.*?)```", page, re.DOTALL)[1]
    mapping = parse_mapping(yaml.safe_load(block))
    points = {source.to for source in mapping.measurements}
    assert len(mapping.commands) == 1 and points == {"P0", "P1", "left/pressure"}

"""The version has one source, examples in docstrings are true, and documents for contributors name what exists."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import ldcs_ros

ROOT = Path(__file__).resolve().parents[2]
VERSION = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")
WITH_EXAMPLES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "ldcs_ros").rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


def test_the_version_of_the_package_is_that_of_its_manifest():
    assert ldcs_ros.__version__ == VERSION
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == VERSION
    assert "version=manifest.findtext" in (ROOT / "setup.py").read_text(encoding="utf-8")


def test_some_docstrings_have_examples():
    assert WITH_EXAMPLES


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_of_docstrings_are_true(module):
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried > 0 and failed == 0


def test_the_files_that_the_page_for_contributors_names_exist():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"\]\(([^)]+)\)", page) + re.findall(r"`((?:tools|test|ldcs_ros|docs)/[\w./]+)`", page)
    missing = [name for name in named if not (ROOT / name).exists()]
    assert named and missing == []


def test_the_make_targets_that_the_page_for_contributors_names_exist():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z]+)", page)) <= targets

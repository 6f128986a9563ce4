"""docs/reference.md is what the code says."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

ROOT = Path(__file__).resolve().parents[2]


def test_the_reference_is_what_the_code_says():
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "tools/make_reference.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    written = (ROOT / "docs/reference.md").read_text(encoding="utf-8").splitlines()
    said = tool.page().splitlines()
    stale = [line for line in said if line not in written] + [line for line in written if line not in said]
    assert written == said, f"run `make docs`: {stale[:4]}"

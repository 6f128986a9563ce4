"""The runs of this folder as tests of a few seconds; they need ROS."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
sys.path[:0] = [str(Path(__file__).parents[2] / "tools" / "stress"), str(Path(__file__).parents[1] / "ros")]

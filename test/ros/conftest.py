"""Fixtures of the tests that need ROS: nodes in processes of their own, on domains of their own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "twin"))

from live import LiveNode, PlainUser, own_domain


@pytest.fixture
def start(tmp_path):
    """Start a node with parameters and a plain user on the same domain; both end with the test."""
    running = []

    def begin(*, with_user=True, **parameters):
        domain = own_domain()
        node = LiveNode(tmp_path / f"node{len(running)}.log", domain, **parameters)
        user = PlainUser(domain) if with_user else None
        running.append((node, user))
        return node, user

    yield begin
    for node, user in running:
        node.end()
        if user is not None:
            user.close()

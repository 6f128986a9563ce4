"""Fixtures of the interface tests: a twin on rails, and everything that it emitted."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fake_scene import Collector, RailScene

from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin


@pytest.fixture
def run():
    """Return a twin on rails and the list of what it emits."""

    def build(scene=None, *, watchdog=None, has_subscribers=None, **settings):
        collected = Collector()
        options = {"watchdog": watchdog, "has_subscribers": has_subscribers}
        return Twin(scene or RailScene(), RunSettings(**settings), sinks=[collected], **options), collected

    return build

"""Fixtures of the bridge tests: a small sheet, a clock that is turned by hand, a bench of rig and bridge."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rig_bench import HandClock


@pytest.fixture
def clock():
    """Return a steady clock that stays constant until `pass_time`."""
    return HandClock()

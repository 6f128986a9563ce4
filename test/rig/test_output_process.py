"""The output process vents a valve island without a watchdog when its bridge is killed, also without a terminal."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tools" / "attack"))

import pytest
from island import Island

from ldcs_ros.rig.limits import Limits

pytestmark = pytest.mark.timed

PROMISE = Limits().command_timeout + Limits().vent_time
BRIDGE = """
import sys, time
from ldcs_ros.rig.rig_file import load_rig
(link,) = load_rig({{"links": [{link!r}]}}).connect(time.monotonic, commands=True)
link.start()
link.wait_until_ready()
while True:
    link.send((80e3, 80e3), 1)
    time.sleep(0.01)
"""


def wait_until(condition, timeout):
    """Wait for a condition; return how long it took [s]."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < timeout, f"not within {timeout} s"
        time.sleep(0.01)
    return time.monotonic() - start


def test_a_killed_bridge_with_a_closed_terminal_leaves_no_pressure():
    island = Island()
    reading, writing = os.pipe()
    bridge = subprocess.Popen(
        [sys.executable, "-c", BRIDGE.format(link=island.link())], stdout=writing, stderr=writing
    )
    os.close(writing)
    try:
        wait_until(lambda: min(island.chambers.setpoint()) > 790.0, 20.0)
        os.close(reading)
        bridge.kill()
        bridge.wait()
        assert wait_until(lambda: max(island.chambers.setpoint()) == 0.0, 5.0) < PROMISE
    finally:
        bridge.kill()
        bridge.wait()
        island.close()

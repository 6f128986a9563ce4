"""The example of a closed loop brings a point of a running twin to its height, as the first hour says."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.timed

EXAMPLE = Path(__file__).resolve().parents[2] / "docs/examples/close_a_loop.py"


@pytest.mark.timeout(120)
def test_the_loop_holds_the_height_that_it_is_told(start, tmp_path):
    node, user = start(scene="rig")
    user.listen("/ldcs/truth/P1/pose", "geometry_msgs/PoseStamped")
    heights = user.received["/ldcs/truth/P1/pose"]
    with open(tmp_path / "loop.log", "w") as log:
        loop = subprocess.Popen(
            [sys.executable, str(EXAMPLE), "--point", "P1", "--height", "0.040"],
            env={**os.environ, "ROS_DOMAIN_ID": str(node.domain)},
            stdout=log,
            stderr=log,
        )
    try:
        # Half a second within a millimetre, at any pace.
        user.until(
            lambda: len(heights) > 25 and all(abs(m.pose.position.z - 0.040) < 1e-3 for m in heights[-25:]),
            timeout=90.0,
        )
        loop.send_signal(signal.SIGINT)
        assert loop.wait(20.0) == 0, (tmp_path / "loop.log").read_text()
    finally:
        if loop.poll() is None:
            loop.kill()
            loop.wait(10.0)
    assert "kPa" in (tmp_path / "loop.log").read_text()


def test_a_scene_without_a_tracker_says_that_it_sends_no_poses(start):
    node, user = start(scene="single_spring")
    end = time.monotonic() + 30.0
    while "nothing is sent on POINT/pose" not in node.output:
        assert time.monotonic() < end, node.output
        user.spin(0.1)

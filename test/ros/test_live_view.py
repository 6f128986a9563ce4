"""`ldcs view --live` shows the running twin from its topics, and ends by Ctrl-C with status 0."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from rclpy.node import Node

from ldcs_ros.ros.live_view import Listener

VIEW = [sys.executable, "-m", "ldcs_ros", "view", "--live", "--port", "0", "--no-browser", "--json"]


@pytest.fixture
def view(start):
    """Start a twin and `ldcs view --live` beside it; the view's process, which ends with the test."""
    processes = []

    def begin(*words, **parameters):
        node, user = start(**parameters)
        environment = {**os.environ, "ROS_DOMAIN_ID": str(node.domain)}
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            [*VIEW, *words], env=environment, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
        processes.append(process)
        return node, user, process

    yield begin
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=10.0)


def test_a_running_twin_is_listened_to_and_saved(view, tmp_path):
    pytest.importorskip("rerun", reason="the viewer is not installed: make viewer")
    file = tmp_path / "live.rrd"
    _, user, process = view("--save", str(file), scene="rig")
    assert json.loads(process.stdout.readline())["url"].startswith("http://127.0.0.1:")
    wanted = {f"/ldcs/{name}" for name in ("nodes", "arms", "loads", "truth/P1/pose", "left/pressure")}

    def heard():
        return all(
            any(info.node_name == "ldcs_view" for info in user.node.get_subscriptions_info_by_topic(topic))
            for topic in wanted
        )

    user.until(heard, timeout=30.0)
    # Markers are built for it, not the mesh, which it makes of the nodes.
    assert not user.node.get_subscriptions_info_by_topic("/ldcs/surface")
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=20.0)
    assert process.returncode == 0, told
    assert told == ""
    assert file.stat().st_size > 10_000


def test_gauge_pressures_are_above_the_air_that_the_twin_is_told(start):
    class Viewer:
        ambient_pressure = 0.0

        def receive(self, topic, kind, cdr):
            pass

    _, user = start(scene="rig", ambient_pressure=90e3)
    viewer = Viewer()
    node = Node("ldcs_view", namespace="/ldcs", context=user.node.context)
    user.node.executor.add_node(node)
    listener = Listener(node, viewer)
    assert user.until(lambda: listener.search() or viewer.ambient_pressure == 90e3, timeout=30.0)


def test_a_live_view_that_cannot_be_says_why_in_one_line():
    words = [word if word != "--live" else "--live=no name!" for word in VIEW]
    done = subprocess.run(words, capture_output=True, text=True, timeout=50.0)
    assert done.returncode == 2
    assert done.stderr.startswith("live_view: ") and done.stderr.count("\n") == 1, done.stderr

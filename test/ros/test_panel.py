"""`ldcs view --live --panel` drives a running twin by its own topics and services, and records what it hears."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.ros.common.optional import import_problem

PANEL = [
    sys.executable,
    "-m",
    "ldcs_ros.ros",
    "live_view",
    "--panel",
    "--port",
    "0",
    "--no-browser",
    "--json",
]


@pytest.mark.timeout(120)
def test_the_panel_drives_pushes_pauses_and_records(start, tmp_path):
    node, _ = start(with_user=False, scene="rig", ambient_pressure=90e3)
    log = tmp_path / "panel.log"
    stream = open(log, "w")  # noqa: SIM115  # of the process
    process = subprocess.Popen(
        [*PANEL, "--record", str(tmp_path / "bags")],
        env={**os.environ, "ROS_DOMAIN_ID": str(node.domain)},
        stdout=subprocess.PIPE,
        stderr=stream,
        text=True,
        start_new_session=True,
    )
    stream.close()
    try:
        address = urlsplit(json.loads(process.stdout.readline())["url"])

        def ask(method, path, body=None):
            assert process.poll() is None, log.read_text()
            connection = http.client.HTTPConnection(address.hostname, address.port, timeout=20.0)
            try:
                text = None if body is None else json.dumps(body)
                connection.request(method, address.path + path, text, {"Content-Type": "application/json"})
                return json.loads(connection.getresponse().read())
            finally:
                connection.close()

        def until(condition):
            end = time.monotonic() + 40.0
            while not condition(state := ask("GET", "state")):
                assert time.monotonic() < end, state
                time.sleep(0.1)
            return state

        def command(**request):
            answer = ask("POST", "command", request)
            assert answer["done"], answer
            return answer["message"]

        # The schedule of the scene holds 140 kPa; a slider of one arm leaves the other where it is.
        state = until(lambda s: [arm["commanded"] for arm in s.get("arms", [])] == [140.0, 140.0])
        assert [(arm["least"], arm["most"]) for arm in state["arms"]] == [(0.0, 200.0)] * 2
        until(
            lambda s: all(abs(arm["measured"] - 140.0) < 2.0 for arm in s["arms"])
        )  # above the air of the twin
        bag = Path(command(do="record", on=True).removeprefix("recording into "))
        command(do="drive", arm="left", value=60.0)
        until(lambda s: [round(arm["commanded"], 6) for arm in s["arms"]] == [60.0, 140.0])
        refused = ask("POST", "command", {"do": "drive", "arm": "left", "value": 500.0})
        assert not refused["done"] and "expected 0 ... 200 kPa" in refused["message"]
        assert not ask("POST", "command", {"do": "drive", "arm": "middle", "value": 5.0})["done"]
        if not import_problem("ldcs_msgs"):
            pushed = command(do="push", point="node_top_8_4", force=[0.0, 0.0, -0.2], duration=0.1)
            assert "node_top_8_4" in pushed
        command(do="pause")
        assert not ask("POST", "command", {"do": "explode"})["done"]
        before = until(lambda s: s["status"].get("mode") == "paused")["time"]
        command(do="step")
        assert until(lambda s: s["time"] > before)["time"] == pytest.approx(before + 0.02, abs=1e-6)
        command(do="resume")
        until(lambda s: s["time"] > before + 0.1)
        command(do="record", on=False)
        assert {"/ldcs/nodes", "/ldcs/pressure_command"} <= set(read_bag(bag).topics)
        command(do="reset")
        until(lambda s: [arm["commanded"] for arm in s["arms"]] == [140.0, 140.0])
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(20.0) == 0
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=10.0)

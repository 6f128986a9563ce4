"""The control panel's page: who may ask, what is refused, and what its controls send in a headless browser."""

from __future__ import annotations

import http.client
import json
import time
from urllib.parse import urlsplit

import numpy as np
import pytest

from ldcs_ros.errors import CommandError
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.viewing.browser import _Chromium, find_browser
from ldcs_ros.viewing.panel_server import panel_site

JSON = {"Content-Type": "application/json"}


class FakeTwin:
    """A flat sheet with two arms that notes what it is asked."""

    def __init__(self):
        self.asked = []
        rest = Lattice(size=(0.14, 0.14, 0.01), nodes=(5, 5), mass=0.16).reference_position
        self.position = np.round(rest, 6).tolist()

    def state(self):
        arm = {"unit": "kPa", "digits": 1, "least": 0.0, "most": 200.0, "commanded": 20.0, "measured": 19.5}
        return {
            "title": "a fake",
            "time": 1.25,
            "nodes": [5, 5],
            "length": 0.14,
            "position": self.position,
            "points": {"P1": [0.14, 0.0, 0.0]},
            "arms": [{"name": name, **arm} for name in ("left", "right")],
            "status": {"pace": "1.00 x real time"},
            "recording": None,
        }

    def command(self, request):
        self.asked.append(request)
        if request.get("do") == "forbidden":
            raise CommandError("forbidden: got\n a joke")
        return "done so"


@pytest.fixture
def served():
    twin = FakeTwin()
    with panel_site(0, twin) as address:
        yield twin, address


def ask(address, method, path, body=None, **headers):
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=20.0)
    try:
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        return answer, answer.read()
    finally:
        connection.close()


def test_page_state_and_commands_are_served_to_the_holder_of_the_address(served):
    twin, address = served
    root = urlsplit(address).path
    answer, page = ask(address, "GET", root)
    assert answer.status == 200 and b"panel.js" in page
    assert "http" not in answer.headers["Content-Security-Policy"]
    assert ask(address, "GET", f"{root}panel.js")[0].status == 200
    assert json.loads(ask(address, "GET", f"{root}state")[1])["title"] == "a fake"
    _, told = ask(address, "POST", f"{root}command", json.dumps({"do": "pause"}), **JSON)
    assert json.loads(told) == {"done": True, "message": "done so"}
    _, told = ask(address, "POST", f"{root}command", json.dumps({"do": "forbidden"}), **JSON)
    assert json.loads(told) == {"done": False, "message": "forbidden: got a joke"}
    assert [request["do"] for request in twin.asked] == ["pause", "forbidden"]


def test_nobody_else_commands(served):
    twin, address = served
    root = urlsplit(address).path
    command = json.dumps({"do": "pause"})
    refused = [
        ask(address, "POST", "/command", command, **JSON),
        ask(address, "POST", f"{root}command", command, Host="example.org", **JSON),
        ask(address, "POST", f"{root}command", command, **{"Content-Type": "text/plain"}),
        ask(address, "POST", f"{root}state", command, **JSON),
        ask(address, "POST", f"{root}command", " " * 20_000, **JSON),
        ask(address, "GET", "/state"),
        ask(address, "GET", f"{root}../panel_server.py"),
    ]
    assert [answer.status for answer, _ in refused] == [403, 403, 400, 400, 413, 403, 404]
    assert not [n for answer, _ in refused for n in answer.headers if n.lower().startswith("access-control")]
    for body in ("[1]", "nonsense", "[" * 9_000):
        assert json.loads(ask(address, "POST", f"{root}command", body, **JSON)[1])["done"] is False
    assert twin.asked == []


@pytest.mark.timeout(90)
@pytest.mark.skipif(find_browser() is None, reason="no chromium here to use the page")
def test_a_person_moves_a_slider_clicks_the_sheet_and_pushes(served, tmp_path):
    twin, address = served
    chromium = _Chromium(find_browser(), str(tmp_path), (1200, 760))
    try:
        page = chromium.open_page((1200, 760))

        def evaluate(script):
            return chromium.ask("Runtime.evaluate", page, expression=script)["result"].get("value")

        def until(script, wanted=True):
            end = time.monotonic() + 20.0
            while (value := evaluate(script)) != wanted:
                assert time.monotonic() < end, (script, value)
                time.sleep(0.05)

        chromium.ask("Page.navigate", page, url=address)
        until("!!document.getElementById('arm_left')")
        assert evaluate("document.getElementById('title').textContent") == "a fake"
        assert evaluate("document.querySelector('#arms label span').textContent") == "20.0 kPa, measured 19.5"
        evaluate(
            "{const s = document.getElementById('arm_left'); s.value = 55; s.dispatchEvent(new Event('input'))}"
        )
        until("document.getElementById('told').textContent", "done so")
        assert twin.asked[-1] == {"do": "drive", "arm": "left", "value": 55}
        evaluate("document.getElementById('push').click()")
        until("document.getElementById('told').className", "refused")
        for kind in ("mousePressed", "mouseReleased"):
            chromium.ask(
                "Input.dispatchMouseEvent", page, type=kind, x=430, y=380, button="left", clickCount=1
            )
        until("document.getElementById('place').textContent.startsWith('node_top_')")
        evaluate("document.getElementById('push').click()")
        until("document.getElementById('told').className", "")
        pushed = twin.asked[-1]
        assert pushed["do"] == "push" and pushed["force"] == [0, 0, -0.2] and pushed["duration"] == 0.5
        for name in ("pause", "resume", "step", "reset", "rearm", "zero", "record"):
            evaluate(f"document.getElementById('{name}').click()")
        until("document.getElementById('told').textContent", "done so")
        end = time.monotonic() + 10.0
        while len(twin.asked) < 9:
            assert time.monotonic() < end
            time.sleep(0.05)
        assert {request["do"] for request in twin.asked[2:]} == {
            "pause",
            "resume",
            "step",
            "reset",
            "rearm",
            "zero",
            "record",
        }
    finally:
        chromium.end()

"""The view in a real browser: the sheet is drawn, the page is here alone and talks to nobody else."""

from __future__ import annotations

import http.client
import io
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from ldcs_ros.cli.main import main
from ldcs_ros.messages.display.colours import of_height
from ldcs_ros.viewing import rerun_package, web_server
from ldcs_ros.viewing.browser import find_browser

NEEDS_RERUN = "the viewer is not installed: make viewer"


@pytest.fixture
def viewer():
    return pytest.importorskip("rerun", reason=NEEDS_RERUN)


@pytest.fixture
def shown(bag, viewer):
    """`ldcs view` on the bag, in a process of its own: its address and the process."""
    command = [sys.executable, "-m", "ldcs_ros", "view", str(bag), "--port", "0", "--no-browser", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    text = ""
    while not text.rstrip().endswith("}"):
        text += process.stdout.readline()
    yield json.loads(text)["url"], process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(10.0)
    process.stdout.close()


def get(url, path="/", **headers):
    """Return the answer to a path below the address of the page, or to an absolute one that begins with its token."""
    parts = urlsplit(url)
    full = path if path.startswith(parts.path) else f"{parts.path.rstrip('/')}{path}"
    return get_raw(parts.port, full, headers)


def get_raw(port, path, headers=None):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)
    connection.request("GET", path, headers=headers or {})
    answer = connection.getresponse()
    return answer, answer.read()


def listening_addresses(pid):
    """Return the local addresses on which a process and its children listen."""
    pids = {pid} | {int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()}
    sockets = set()
    for one in pids:
        for link in Path(f"/proc/{one}/fd").iterdir():
            try:
                sockets.add(os.readlink(link))
            except OSError:
                continue
    addresses = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                addresses.add(fields[1].split(":")[0])
    return addresses


@pytest.mark.timeout(150)
def test_a_browser_draws_the_sheet_in_the_colours_of_its_height(bag, viewer, tmp_path, capsys):
    if find_browser() is None:
        pytest.skip("no chromium here to draw the page")
    from PIL import Image

    path = tmp_path / "view.png"
    assert main(["view", str(bag), "--screenshot", str(path)]) == 0
    assert str(path) in capsys.readouterr().out
    picture = np.asarray(Image.open(io.BytesIO(path.read_bytes())).convert("RGB")).astype(int)
    assert picture.shape == (850, 1400, 3)
    scale = 255.0 * of_height(np.linspace(-0.3, 0.5, 60) * 0.14, 0.14)[:, :3]
    sheet = picture[60:800, :840].reshape(-1, 3)
    # The lamp changes brightness, not hue: compare directions in colour space.
    strong = sheet[(sheet.max(axis=1) - sheet.min(axis=1)) > 60].astype(float)
    hue = strong / np.linalg.norm(strong, axis=1, keepdims=True)
    known = scale / np.linalg.norm(scale, axis=1, keepdims=True)
    close = (hue @ known.T).max(axis=1) > 0.995
    assert len(strong) > 0.05 * len(sheet)
    assert close.mean() > 0.9
    plots = picture[60:800, 860:1390]
    vermillion = (np.abs(plots - np.array([213, 94, 0])).max(axis=2) < 40).sum()
    assert vermillion > 300


def test_the_page_is_here_alone_and_may_talk_to_nobody_else(shown):
    url, process = shown
    assert url.startswith("http://127.0.0.1:")
    assert listening_addresses(process.pid) == {"0100007F"}
    answer, _ = get(url)
    assert answer.status == 302
    answer, page = get(url, answer.headers["Location"])
    assert answer.status == 200 and b"re_viewer.js" in page
    policy = dict(part.split(" ", 1) for part in answer.headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == policy["connect-src"].strip() == "'self'"
    assert all("http" not in allowed for allowed in policy.values())
    assert get(url, "/recording.rrd")[1][:4] in (b"RRF2", b"RRIO", b"RRF0")
    # A foreign page whose name resolves to this machine gets nothing.
    assert get(url, "/recording.rrd", Host="example.org")[0].status == 403


def test_nothing_is_served_without_the_token(shown):
    url, process = shown
    port, token = urlsplit(url).port, urlsplit(url).path.strip("/")
    assert len(token) >= 32
    for path in ("/", "/recording.rrd", "/re_viewer.js", f"/{token[:-1]}/recording.rrd", f"/{token}"):
        assert get_raw(port, path)[0].status == 403, path
    assert get_raw(port, f"/{token}/recording.rrd")[0].status == 200
    # Other users of the machine can read the arguments of a process.
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    for child in children:
        assert token.encode() not in Path(f"/proc/{child}/cmdline").read_bytes()


def test_two_host_headers_or_another_port_get_nothing(shown):
    url, _ = shown
    parts = urlsplit(url)
    for hosts in ([], [parts.netloc, "example.org"], ["127.0.0.1:1"], ["example.org"]):
        lines = "".join(f"Host: {host}\r\n" for host in hosts)
        with socket.create_connection(("127.0.0.1", parts.port), timeout=20.0) as connection:
            connection.sendall(f"GET {parts.path}recording.rrd HTTP/1.1\r\n{lines}\r\n".encode())
            assert connection.recv(64).split()[1] == b"403", hosts


def test_no_other_origin_may_read_an_answer(shown):
    url, _ = shown
    for path in ("/recording.rrd", "/re_viewer.js", "/favicon.ico"):
        answer, _ = get(url, path, Origin="http://example.org")
        assert answer.status == 200
        assert not [name for name in answer.headers if name.lower().startswith("access-control")]


def test_a_connection_that_says_nothing_is_closed(monkeypatch, tmp_path):
    monkeypatch.setattr(web_server._Handler, "timeout", 0.2)
    (tmp_path / "x.rrd").write_bytes(b"RRF2")
    with (
        web_server._offline_proxy(0, tmp_path / "x.rrd") as gate,
        socket.create_connection(("127.0.0.1", gate.server_port), timeout=10.0) as silent,
    ):
        silent.sendall(b"GET ")
        assert silent.recv(1) == b""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_view_with_all_that_it_started(shown, number):
    _url, process = shown
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert children
    os.kill(process.pid, number)
    assert process.wait(10.0) == 0
    assert not any(Path(f"/proc/{child}").exists() for child in children)


def test_a_killed_view_leaves_no_viewer_behind(shown):
    _url, process = shown
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(process.pid, signal.SIGKILL)
    process.wait(10.0)
    end = time.monotonic() + 5.0
    while any(Path(f"/proc/{child}").exists() for child in children):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_port_that_is_taken_is_named(bag, viewer, capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["view", str(bag), "--port", str(port)]) == 2
    complaint = capsys.readouterr().err
    assert f"port {port} of 127.0.0.1 cannot be used" in complaint and "--port" in complaint


def test_a_file_is_written_for_any_viewer(bag, viewer, tmp_path, capsys):
    assert main(["view", str(bag), "--save", str(tmp_path / "lift.rrd"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["surfaces"] == 21
    assert (tmp_path / "lift.rrd").stat().st_size > 10_000


def test_without_the_viewer_it_says_what_to_install(bag, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["view", str(bag)]) == 2
    complaint = capsys.readouterr().err
    assert "install it with `make viewer`" in complaint and complaint.count("\n") == 1
    monkeypatch.setattr("ldcs_ros.extras.in_checkout", lambda: False)
    assert main(["view", str(bag)]) == 2
    assert "-m pip install 'rerun-sdk>=0.39'" in capsys.readouterr().err


def test_without_a_browser_a_picture_is_refused(bag, viewer, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["view", str(bag), "--screenshot", str(tmp_path / "none.png")]) == 2
    assert "install chromium" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "a BAG, or --live"),
        (["bag", "--live"], "not both"),
        (["nowhere"], "no bag at nowhere"),
        (["bag", "--port", "70000"], "expected a port"),
        (["--live", "--until", "1.0"], "belong to a bag"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(words, complaint, capsys):
    assert main(["view", *words]) == 2
    told = capsys.readouterr().err
    assert complaint in told and told.count("\n") == 1


def test_markers_need_no_viewer(bag, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["view", str(bag), "--markers", str(tmp_path / "marked")]) == 0
    assert "44 marker messages added" in capsys.readouterr().out


def test_the_viewer_keeps_no_account_of_us_in_the_home(viewer, tmp_path):
    with rerun_package.quiet_environment() as environment:
        told = subprocess.run(
            [str(rerun_package.program()), "analytics", "config"],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        assert environment["XDG_CONFIG_HOME"] != os.environ.get("XDG_CONFIG_HOME")
    assert "analytics_enabled: false" in told.replace('"', "").replace("=", ": ")

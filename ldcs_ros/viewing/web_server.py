"""The web site of a view: the viewer's page, and the recording or the live data, on 127.0.0.1 alone."""

from __future__ import annotations

import ctypes
import http.client
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlencode, urlsplit

from ldcs_ros.errors import ViewingError
from ldcs_ros.viewing.guarded_server import HOST, GuardedHandler, GuardedServer, port_refused, serving
from ldcs_ros.viewing.rerun_package import program, quiet_environment

RECORDING = "/recording.rrd"
_START_TIMEOUT = 20.0
_PIECE = 1 << 16
_HEADERS = ("content-type", "content-length", "content-encoding", "rerun-final-length")
"""Headers of the viewer that the proxy forwards; Access-Control-Allow-Origin is not among them."""
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG


@dataclass(frozen=True)
class Site:
    """A page with its data.

    Attributes:
        address: Address of the page, with the token that every request needs.
        data_url: Address of the page's data: a .rrd file, or the viewer's live server.
    """

    address: str
    data_url: str


@contextmanager
def bag_site(recording: Path, port: int) -> Iterator[Site]:
    """Serve a .rrd file with the viewer.

    Args:
        recording: The file.
        port: Port of the page; 0 for any.

    Raises:
        ViewingError: The port is taken, or the viewer does not start.
    """
    with _offline_proxy(port, recording) as proxy:
        proxy.data_url = f"{proxy.address.removesuffix('/')}{RECORDING}"
        # Without the token: other users can read the arguments of a process.
        with _viewer_program(proxy, [f"http://{HOST}:{proxy.server_port}{RECORDING}"]):
            yield Site(proxy.address, proxy.data_url)


@contextmanager
def live_site(port: int, *, memory: str) -> Iterator[Site]:
    """Serve the viewer with a server that takes data as they come; a stream connects to the site's `data_url`.

    Args:
        port: Port of the page; 0 for any.
        memory: Memory of the server for browsers that connect later, such as '1GiB'; the oldest data go first.

    Raises:
        ViewingError: The port is taken, or the viewer does not start.
    """
    with _offline_proxy(port, None) as proxy:
        data_port = _free_port()
        proxy.data_origin = f"http://{HOST}:{data_port}"
        proxy.data_url = f"rerun+{proxy.data_origin}/proxy"
        with _viewer_program(proxy, ["--port", str(data_port), "--server-memory-limit", memory]):
            yield Site(proxy.address, proxy.data_url)


class _OfflineProxy(GuardedServer):
    """A proxy of the viewer's page, with a policy that allows the page no other address."""

    def __init__(self, port: int, recording: Path | None) -> None:
        super().__init__(port, _Handler)
        self.recording = recording
        self.data_url = ""
        self.data_origin = ""
        self.viewer_port = 0

    @property
    def policy(self) -> str:
        """The content security policy: the page asks for fonts and reports its use on the internet otherwise."""
        inline = "'self' 'unsafe-inline'"
        return (
            f"default-src 'self'; script-src {inline} 'wasm-unsafe-eval'; style-src {inline}; "
            f"img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' {self.data_origin}"
        )

    @property
    def page_query(self) -> str:
        """The page's query: our data, nothing stored in the browser."""
        asked = {"url": self.data_url, "hide_welcome_screen": "1", "persist": "0", "theme": "light"}
        return urlencode(asked, quote_via=quote)


class _Handler(GuardedHandler):
    server: _OfflineProxy

    def do_GET(self) -> None:  # noqa: N802  # the name of the base class
        path = self.admitted_path()
        if path is None:
            return
        if urlsplit(path).path == RECORDING and self.server.recording is not None:
            self._send_file(self.server.recording)
        elif path == "/":
            # The query of the page is part of its address; the redirect adds it.
            self.send_response(302)
            self.send_header("Location", f"/{self.server.token}/?{self.server.page_query}")
            self.send_header("Content-Length", "0")
            self.end_headers()
        else:
            self._forward(path)

    def _send_file(self, path: Path) -> None:
        with open(path, "rb") as stream:
            self.send_response(200)
            self.send_header("Content-Type", "application/octet-stream")
            self.send_header("Content-Length", str(path.stat().st_size))
            self.end_headers()
            while piece := stream.read(_PIECE):
                self.wfile.write(piece)

    def _forward(self, path: str) -> None:
        connection = http.client.HTTPConnection(HOST, self.server.viewer_port, timeout=_START_TIMEOUT)
        try:
            connection.request("GET", path, headers={"Accept-Encoding": "identity"})
            answer = connection.getresponse()
            self.send_response(answer.status)
            for name, value in answer.getheaders():
                if name.lower() in _HEADERS:
                    self.send_header(name, value)
            self.send_header("Content-Security-Policy", self.server.policy)
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            while piece := answer.read(_PIECE):
                self.wfile.write(piece)
        except OSError:
            self.close_connection = True
        finally:
            connection.close()


@contextmanager
def _offline_proxy(port: int, recording: Path | None) -> Iterator[_OfflineProxy]:
    try:
        proxy = _OfflineProxy(port, recording)
    except OSError as error:
        raise port_refused(port, error) from error
    with serving(proxy):
        yield proxy


@contextmanager
def _viewer_program(proxy: _OfflineProxy, arguments: list[str]) -> Iterator[None]:
    proxy.viewer_port = _free_port()
    command = [str(program()), "--serve-web", "--bind", HOST, "--web-viewer-port", str(proxy.viewer_port)]
    with quiet_environment() as environment:
        process = subprocess.Popen(
            [*command, *arguments],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            # Ctrl-C reaches this process alone, and the viewer ends with it.
            start_new_session=True,
            preexec_fn=_die_with_parent if sys.platform == "linux" else None,
        )
        try:
            _wait_for(process, proxy.viewer_port)
            yield
        finally:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            assert process.stderr is not None
            process.stderr.close()


def _wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    deadline = time.monotonic() + _START_TIMEOUT
    while time.monotonic() < deadline:
        if process.poll() is not None:
            assert process.stderr is not None
            said = process.stderr.read().decode(errors="replace").strip().splitlines()
            raise ViewingError(f"the viewer ended with status {process.returncode}: {(said or ['-'])[-1]}")
        with socket.socket() as attempt:
            if attempt.connect_ex((HOST, port)) == 0:
                return
        time.sleep(0.02)
    raise ViewingError(f"the viewer did not answer on port {port} within {_START_TIMEOUT:g} s")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


def _die_with_parent() -> None:
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGTERM)

"""The page of the control panel: its files, the state as JSON, and the commands of its buttons."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from ldcs_ros.errors import LdcsError
from ldcs_ros.viewing.guarded_server import GuardedHandler, GuardedServer, port_refused, serving

_FILES = {"/": ("panel.html", "text/html"), "/panel.js": ("panel.js", "text/javascript")}
_POLICY = "default-src 'self'; style-src 'self' 'unsafe-inline'"
_MOST_BYTES = 10_000
_JSON = "application/json"


class ControlledTwin(Protocol):
    """What the panel shows and commands."""

    def state(self) -> Mapping[str, object]:
        """Return what the page shows, as plain values."""

    def command(self, request: Mapping[str, object]) -> str:
        """Carry out a request of the page and return what was done.

        Raises:
            LdcsError: It is refused.
        """


class PanelServer(GuardedServer):
    """The server of the page, for one twin.

    Args:
        port: Port of the page; 0 for any.
        twin: What it shows and commands.
    """

    def __init__(self, port: int, twin: ControlledTwin) -> None:
        super().__init__(port, _Handler)
        self.twin = twin


@contextmanager
def panel_site(port: int, twin: ControlledTwin) -> Iterator[str]:
    """Serve the panel of a twin; yield the address of the page.

    Raises:
        ViewingError: The port is taken.
    """
    try:
        server = PanelServer(port, twin)
    except OSError as error:
        raise port_refused(port, error) from error
    with serving(server):
        yield server.address


class _Handler(GuardedHandler):
    server: PanelServer

    def do_GET(self) -> None:  # noqa: N802  # the name of the base class
        path = self.admitted_path()
        if path is None:
            return
        if path == "/state":
            self._answer(200, _JSON, json.dumps(self.server.twin.state()).encode())
        elif path in _FILES:
            name, kind = _FILES[path]
            self._answer(200, kind, (Path(__file__).parent / "panel" / name).read_bytes())
        else:
            self.send_error(404)

    def do_POST(self) -> None:  # noqa: N802  # the name of the base class
        path = self.admitted_path()
        if path is None:
            return
        # A form of a foreign page can send other types without asking; this one it cannot.
        length = self.headers.get("Content-Length", "")
        if path != "/command" or self.headers.get("Content-Type") != _JSON or not length.isdecimal():
            self.send_error(400, "expected a command as JSON")
            return
        if int(length) > _MOST_BYTES:
            self.send_error(413)
            return
        try:
            request = json.loads(self.rfile.read(int(length)))
            if not isinstance(request, dict):
                raise ValueError("expected an object")
            answer = {"done": True, "message": self.server.twin.command(request)}
        except (LdcsError, ValueError, RecursionError) as error:
            answer = {"done": False, "message": " ".join(str(error).split())[:500]}
        self._answer(200, _JSON, json.dumps(answer).encode())

    def _answer(self, status: int, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", _POLICY)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

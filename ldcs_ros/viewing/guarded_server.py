"""A web server on 127.0.0.1 alone: a token in every address, one Host header, bounded connections and idle times."""

from __future__ import annotations

import secrets
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from ldcs_ros.errors import ViewingError

HOST = "127.0.0.1"
_TOKEN_BYTES = 24
_IDLE_TIMEOUT = 30.0
"""Time in which a connection must send its request, and take each piece of the answer [s]."""
_MOST_CONNECTIONS = 64
Request = socket.socket | tuple[bytes, socket.socket]
Address = tuple[str, int]


class GuardedServer(ThreadingHTTPServer):
    """A server of one page for the person who started it.

    Args:
        port: Port of the page; 0 for any.
        handler: The handler of requests.

    Attributes:
        token: What the path of every request begins with.
    """

    daemon_threads = True

    def __init__(self, port: int, handler: type[GuardedHandler]) -> None:
        super().__init__((HOST, port), handler)
        self.token = secrets.token_urlsafe(_TOKEN_BYTES)
        self._free = threading.BoundedSemaphore(_MOST_CONNECTIONS)

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    @property
    def hosts(self) -> tuple[str, ...]:
        """Values of the Host header under which the page is served."""
        return (f"{HOST}:{self.server_port}", f"localhost:{self.server_port}")

    def process_request(self, request: Request, client_address: Address) -> None:
        """Serve a connection on a thread of its own; one above the limit is closed."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Request, client_address: Address) -> None:
        """Serve a connection, then free its place."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Request, client_address: Address) -> None:
        """Ignore a browser that disconnects; report every other error."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class GuardedHandler(BaseHTTPRequestHandler):
    """A handler that admits a request only by its Host header and its token."""

    server: GuardedServer

    timeout = _IDLE_TIMEOUT

    def admitted_path(self) -> str | None:
        """Return the path after the token; None, with the answer 403 sent, for a request that is not admitted."""
        # Another host name could be a foreign page whose name resolves to this machine.
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or hosts[0].strip().lower() not in self.server.hosts:
            self.send_error(403, "open this page as http://127.0.0.1")
            return None
        token, slash, rest = self.path.removeprefix("/").partition("/")
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self.send_error(403, "open the whole address that the view has printed")
            return None
        return f"/{rest}"

    def log_message(self, *_: object) -> None:
        """Write nothing on the terminal."""


@contextmanager
def serving(server: GuardedServer) -> Iterator[None]:
    """Serve on a thread of its own until the end of the block."""
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def port_refused(port: int, error: OSError) -> ViewingError:
    """Return the error of a port that cannot be opened."""
    return ViewingError(
        f"port {port} of {HOST} cannot be used: {error.strerror}; give another with --port, or 0 for any"
    )

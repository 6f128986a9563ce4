"""A headless Chromium that takes a picture of a page; its own protocol runs over a pipe."""

from __future__ import annotations

import base64
import io
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ldcs_ros.errors import ViewingError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
TIMEOUT = 120.0
_ANSWER_TIMEOUT = 60.0
_PICTURE_PERIOD = 0.5
_FLAGS = (
    "--headless=new",
    "--no-first-run",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--mute-audio",
    "--hide-scrollbars",
    # WebGL in software, for machines without a graphics card.
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe",
)


class CommandRefused(ViewingError):
    """A command that the browser refused."""


def find_browser() -> str | None:
    """Return the path of an installed Chromium or Chrome; None if there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def take_picture(
    url: str,
    *,
    size: tuple[int, int],
    ready: Callable[[np.ndarray], bool],
) -> bytes:
    """Return a PNG of a page, taken when the page is ready and two pictures in a row are equal.

    Args:
        url: Address of the page.
        size: Width and height of the window [pixels].
        ready: Function of a picture, shape (height, width, 3), uint8, that returns whether the page is complete.

    Raises:
        ViewingError: There is no browser, it fails, or the page is not ready in time.
    """
    browser = find_browser()
    if browser is None:
        raise ViewingError(
            f"no browser here for a picture, looked for {list(NAMES)}; install chromium, "
            "or leave --screenshot away and open the page"
        )
    with tempfile.TemporaryDirectory(prefix="ldcs_browser_", ignore_cleanup_errors=True) as profile:
        chromium = _Chromium(browser, profile, size)
        try:
            return _picture(chromium, url, size, ready)
        except ViewingError:
            raise
        except (OSError, EOFError, KeyError) as error:
            raise ViewingError(f"the browser {browser} failed: {error!r}; {chromium.last_line()}") from error
        finally:
            chromium.end()


def _picture(
    chromium: _Chromium,
    url: str,
    size: tuple[int, int],
    ready: Callable[[np.ndarray], bool],
) -> bytes:
    page = chromium.open_page(size)
    deadline = time.monotonic() + TIMEOUT
    chromium.ask("Page.navigate", page, url=url)
    before = np.zeros(0)
    while time.monotonic() < deadline:
        time.sleep(_PICTURE_PERIOD)
        try:
            png = base64.b64decode(chromium.ask("Page.captureScreenshot", page, format="png")["data"])
        except CommandRefused:  # no page during navigation
            continue
        seen = _pixels(png)
        if np.array_equal(seen, before) and ready(seen):
            return png
        before = seen
    raise ViewingError(f"the page was not drawn within {TIMEOUT:g} s: {url}")


def _pixels(png: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


class _Chromium:
    """One browser process; commands go to its descriptor 3, answers come from its descriptor 4."""

    def __init__(self, path: str, profile: str, size: tuple[int, int]) -> None:
        # Imported here: other systems lack it, and have no such browser.
        import fcntl

        pipes = [*os.pipe(), *os.pipe()]
        # Above 3 and 4, which the shell gives to the browser.
        commands, self._commands, self._answers, answers = (
            fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in pipes
        )
        for end in pipes:
            os.close(end)
        self._log = Path(profile) / "stderr"
        flags = [*_FLAGS, f"--window-size={size[0]},{size[1]}", f"--user-data-dir={profile}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            flags.append("--no-sandbox")  # root has no sandbox
        # A shell moves the pipes to the descriptors that the browser uses.
        wire = f'exec "$0" "$@" 3<&{commands} 4>&{answers} {commands}<&- {answers}>&-'
        with open(self._log, "wb") as log:
            self._process = subprocess.Popen(
                ["/bin/bash", "-c", wire, path, *flags, "about:blank"],
                pass_fds=(commands, answers),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,
            )
        os.close(commands)
        os.close(answers)
        self._number = 0
        self._rest = b""

    def open_page(self, size: tuple[int, int]) -> str:
        """Open a page and return its name in commands."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        page: str = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.ask("Page.enable", page)
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.ask("Emulation.setDeviceMetricsOverride", page, **metrics)
        return page

    def ask(self, method: str, page: str | None = None, **parameters: str | int | bool) -> dict[str, Any]:
        """Send one command and return its result."""
        self._number += 1
        command: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if page is not None:
            command["sessionId"] = page
        os.write(self._commands, json.dumps(command).encode() + b"\0")
        deadline = time.monotonic() + _ANSWER_TIMEOUT
        while True:
            answer = self._next_message(deadline)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise CommandRefused(f"the browser refused {method}: {answer['error'].get('message')}")
                result: dict[str, Any] = answer["result"]
                return result

    def last_line(self) -> str:
        """Return the last line that the browser wrote."""
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "no message"

    def end(self) -> None:
        """Close the browser."""
        try:
            self.ask("Browser.close")
        except (OSError, EOFError, ViewingError):
            self._process.kill()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._commands)
        os.close(self._answers)

    def _next_message(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._rest:
            if not select.select([self._answers], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise ViewingError(f"the browser did not answer within {_ANSWER_TIMEOUT:g} s")
            piece = os.read(self._answers, 1 << 16)
            if not piece:
                raise EOFError("it ended")
            self._rest += piece
        message, _, self._rest = self._rest.partition(b"\0")
        decoded: dict[str, Any] = json.loads(message)
        return decoded

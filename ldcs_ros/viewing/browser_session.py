"""A view in a browser: open it, save a picture of it, wait for Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ldcs_ros.errors import ViewingError
from ldcs_ros.viewing.browser import take_picture

PICTURE_SIZE = (1400, 850)
_MIN_COLOURED = 0.01  # fraction of the pixels; a page without its sheet has less
_MIN_CHROMA = 60


def is_rendered(picture: np.ndarray) -> bool:
    """Return whether a picture, shape (height, width, 3), shows a surface: enough pixels of a strong colour."""
    chroma = picture.max(axis=2).astype(int) - picture.min(axis=2)
    return bool((chroma > _MIN_CHROMA).mean() > _MIN_COLOURED)


def save_picture(url: str, path: Path) -> None:
    """Write a picture of a page with a sheet, made by a headless browser.

    Raises:
        ViewingError: There is no browser, or it shows no sheet in time.
    """
    png = take_picture(url, size=PICTURE_SIZE, ready=is_rendered)
    partial = path.with_name(f".{path.name}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(png)
        os.replace(partial, path)
    except OSError as error:
        raise ViewingError(f"{path} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)


def open_browser(url: str) -> None:
    """Open the page on machines with a screen; a browser of the terminal would replace the view."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)


@contextmanager
def until_stopped() -> Iterator[Callable[[float], bool]]:
    """Return a function that waits for some seconds, Ctrl-C or SIGTERM, and returns whether a signal came."""
    stopped = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: stopped.set())
    try:
        yield stopped.wait
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

"""How a view is shown to a person: the address printed, the browser opened, a picture taken, Ctrl-C awaited."""

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
_COLOURED = 0.01  # of a picture: less is a page that has not drawn its sheet
_LEAST_CHROMA = 60


def is_rendered(picture: np.ndarray) -> bool:
    """Tell whether a picture, shape (height, width, 3), holds a surface: enough pixels of a strong colour."""
    chroma = picture.max(axis=2).astype(int) - picture.min(axis=2)
    return bool((chroma > _LEAST_CHROMA).mean() > _COLOURED)


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
    """Open the page where there is a screen; a browser of the terminal would take it over."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)


@contextmanager
def until_stopped() -> Iterator[Callable[[float], bool]]:
    """Give a function that waits for seconds, or for Ctrl-C or SIGTERM, and tells whether one of these came."""
    stopped = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: stopped.set())
    try:
        yield stopped.wait
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

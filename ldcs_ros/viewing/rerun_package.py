"""The Rerun library and program, which are installed by the extra `view`."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Protocol, cast

from ldcs_ros import extras
from ldcs_ros.errors import ViewingError

_APPLICATION = "ldcs"


class Stream(Protocol):
    """A rerun recording stream, as far as views use it; archetypes, columns and layouts are the library's objects."""

    def set_time(self, timeline: str, *, duration: float) -> None:
        """Set the time of the next calls of `log` [s]."""

    def log(self, path: str, archetype: object, *, static: bool = False) -> None:
        """Log an archetype at a path."""

    def send_columns(self, path: str, *, indexes: list[object], columns: object) -> None:
        """Send an archetype at a column of times."""

    def send_blueprint(self, blueprint: object) -> None:
        """Send the layout of the viewer."""

    def save(self, path: Path) -> None:
        """Write the stream into a file from now on."""

    def set_sinks(self, *sinks: object) -> None:
        """Send the stream to sinks from now on."""

    def flush(self) -> None:
        """Wait until all calls are written."""

    def disconnect(self) -> None:
        """End the stream."""


def _advice() -> str:
    command = "make viewer" if extras.in_checkout() else extras.advice("view", "rerun-sdk")
    return f"install it with `{command}` (half a gigabyte with its own web viewer)"


def rerun() -> ModuleType:
    """Return the module `rerun`.

    Raises:
        ViewingError: The module is not installed; the message says how to install it.
    """
    # The library prints a hint for each stream that ends with the process.
    os.environ.setdefault("RUST_LOG", "error")
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise ViewingError(f"the viewer rerun-sdk cannot be loaded ({error}); {_advice()}") from error


def program() -> Path:
    """Return the path of the viewer's program, which contains the web viewer.

    Raises:
        ViewingError: The program is missing.
    """
    rerun()
    try:
        folder = Path(str(importlib.import_module("rerun_cli").__file__)).parent
    except ImportError as error:
        raise ViewingError(f"rerun-sdk has no program of its own ({error}); {_advice()}") from error
    path = folder / ("rerun.exe" if sys.platform == "win32" else "rerun")
    if not path.is_file():
        raise ViewingError(f"no viewer at {path}; {_advice()}")
    return path


def new_stream(name: str) -> Stream:
    """Return an empty rerun recording of our application; it sends nothing before it has a sink.

    Args:
        name: Name of the recording in viewers.
    """
    stream = rerun().RecordingStream(_APPLICATION)
    stream.send_recording_name(name)
    return cast(Stream, stream)


@contextmanager
def quiet_environment() -> Iterator[dict[str, str]]:
    """Return an environment in which the viewer's program sends no reports about its use.

    The program keeps this setting in a file; the user's own file does not change.
    """
    with tempfile.TemporaryDirectory(prefix="ldcs_view_") as folder:
        environment = {**os.environ, "XDG_CONFIG_HOME": folder, "XDG_DATA_HOME": folder, "RUST_LOG": "error"}
        subprocess.run(
            [str(program()), "analytics", "disable"],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        yield environment

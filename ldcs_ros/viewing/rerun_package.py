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
from typing import Any

from ldcs_ros.errors import ViewingError

ADVICE = "install it with `pip install 'ldcs_ros[view]'` (rerun-sdk, half a gigabyte with its own web viewer)"
_APPLICATION = "ldcs"


def rerun() -> Any:
    """Return the module `rerun`.

    Raises:
        ViewingError: It is not installed; says how to install it.
    """
    # It prints a hint of its own for each stream that ends with the process.
    os.environ.setdefault("RUST_LOG", "error")
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise ViewingError(f"the viewer rerun-sdk cannot be loaded ({error}); {ADVICE}") from error


def program() -> Path:
    """Return the viewer's program, which carries the web viewer.

    Raises:
        ViewingError: It is not there.
    """
    rerun()
    try:
        folder = Path(str(importlib.import_module("rerun_cli").__file__)).parent
    except ImportError as error:
        raise ViewingError(f"rerun-sdk has no program of its own ({error}); {ADVICE}") from error
    path = folder / ("rerun.exe" if sys.platform == "win32" else "rerun")
    if not path.is_file():
        raise ViewingError(f"no viewer at {path}; {ADVICE}")
    return path


def new_stream(name: str) -> Any:
    """Return an empty rerun recording of our application; nothing is sent anywhere before it has a sink.

    Args:
        name: What viewers list it as.
    """
    stream = rerun().RecordingStream(_APPLICATION)
    stream.send_recording_name(name)
    return stream


@contextmanager
def quiet_environment() -> Iterator[dict[str, str]]:
    """Give the environment in which the viewer's program reports nothing about its use to anybody.

    The program keeps such a wish in a file; the user's own file is left alone.
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

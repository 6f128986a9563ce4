"""Every error that this package raises on purpose; each message says what, got, expected, where and what to do."""

from __future__ import annotations

import os
from pathlib import Path


class LdcsError(Exception):
    """Base of the errors that a user can act on; the command line prints them as one line."""


class SceneError(LdcsError, ValueError):
    """A scene cannot be loaded or built: nothing was built."""


class CommandError(LdcsError, ValueError):
    """A command (pressure, torque, wrench) was refused whole: nothing changed."""


class SolverError(LdcsError, ValueError):
    """A solver setting cannot work, for example a step above a method's stability limit."""


class DivergenceError(LdcsError, RuntimeError):
    """A step could not be completed; the state before it is whole."""


class RecordingError(LdcsError, OSError):
    """A bag or a table cannot be opened, written or repaired."""


class MappingError(LdcsError, ValueError):
    """A mapping file is invalid, or a message is not what it says."""


class BridgeError(LdcsError, ValueError):
    """A rig file, a mode or a command of the bridge is not sound: nothing was sent."""


class LinkError(LdcsError, OSError):
    """A link to a rig is down; the bridge vents, says so and tries again."""


class MissingPackageError(LdcsError, ImportError):
    """An optional package is needed and not installed; the message has the command that installs it."""


class ViewingError(LdcsError, OSError):
    """A viewer, a browser or a port that is needed to show something is not to be had."""


def user_path(path: str | os.PathLike[str]) -> Path:
    """Return a path that a person gave; `~` is the home folder, as the shell does not replace it in `--bag=~/out`."""
    return Path(os.path.expanduser(path))


def path_in_words(path: str | os.PathLike[str]) -> str:
    """Return a path as text of any alphabet; bytes that are no UTF-8 become a question mark."""
    return os.fsencode(path).decode("utf-8", "replace")


def one_line(error: BaseException) -> str:
    """Return the cause of an error of the system or a library, without line breaks and never empty."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()) or repr(error)

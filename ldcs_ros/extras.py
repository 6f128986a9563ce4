"""Optional packages: loaded when they are asked for; the error of a missing one says what this user can run."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from importlib import metadata
from pathlib import Path
from types import ModuleType

from ldcs_ros.errors import MissingPackageError

_OF_EXTRA = re.compile(r"""^(?P<requirement>[^;]+);.*extra\s*==\s*['"](?P<extra>\w+)['"]""")


def load(module: str, *, extra: str, purpose: str) -> ModuleType:
    """Return an optional module.

    Args:
        module: Its dotted name.
        extra: Extra of this package that lists it, such as 'data'.
        purpose: What it is needed for, the subject of the error's sentence.

    Raises:
        MissingPackageError: It is not installed; the message has the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        package = (error.name or module).partition(".")[0]
        raise MissingPackageError(
            f"{purpose} needs the package '{package}', which is not installed; run `{advice(extra, package)}`"
        ) from error


def advice(extra: str, package: str = "") -> str:
    """Return the command that installs an extra's packages into the running Python.

    It names the packages themselves: a checkout or a wheel from a file is not on an index under its own name.

    Args:
        extra: The extra.
        package: Taken where this installation does not say what the extra holds.
    """
    names = requirements(extra) or ([package] if package else [])
    return f"{shlex.quote(_python())} -m pip install {' '.join(shlex.quote(name) for name in names)}"


def in_checkout() -> bool:
    """Return whether this package runs from a checkout, whose Makefile installs what is optional."""
    return (Path(__file__).resolve().parents[1] / "Makefile").is_file()


def requirements(extra: str) -> list[str]:
    """Return the requirements that the installed package declares for an extra; [] if there is no declaration."""
    try:
        lines = metadata.requires("ldcs_ros") or []
    except metadata.PackageNotFoundError:
        return []
    found = [match for line in lines if (match := _OF_EXTRA.match(line))]
    return [match["requirement"].strip() for match in found if match["extra"] == extra]


def _python() -> str:
    # A path below the present folder is shorter, and the same.
    executable = Path(sys.executable)
    return (
        str(executable.relative_to(Path.cwd())) if executable.is_relative_to(Path.cwd()) else str(executable)
    )

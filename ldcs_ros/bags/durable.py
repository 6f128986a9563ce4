"""Locks and durable writes as far as the operating system has them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol


class HasFileNumber(Protocol):
    """An open file."""

    def fileno(self) -> int:
        """Return its descriptor."""


def lock(stream: HasFileNumber) -> None:
    """Lock a file against other processes until it is closed; nothing where the system has no such locks (Windows).

    Raises:
        BlockingIOError: Another process has locked it.
        OSError: The file system has no locks.
    """
    try:
        import fcntl
    except ImportError:
        return
    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)


def sync_data(stream: HasFileNumber) -> None:
    """Wait until a file's data are on the disk.

    Raises:
        OSError: They cannot be written.
    """
    # macOS and Windows have fsync alone, which writes the file's times, too.
    getattr(os, "fdatasync", os.fsync)(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable, so that a rename survives a power cut; nothing where it cannot be opened.

    Raises:
        OSError: They cannot be written.
    """
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

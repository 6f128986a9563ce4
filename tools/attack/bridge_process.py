"""The bridge under attack: a process of its own in a session of its own, its terminal with times, its children."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

DEVICE_PRIORITY, BRIDGE_PRIORITY = -10, -5
"""Priorities where the system allows them: other work on the machine is no event of the table."""


class BridgeProcess:
    """`bridge` with parameters; every line of its terminal is kept with the time when it came.

    Args:
        environment: Variables of the process.
        arguments: Words after `-m ldcs_ros.ros`; the program first.
        parameters: ROS parameters.
        limit: Applied in the process before it starts.
    """

    def __init__(
        self,
        environment: dict[str, str],
        *arguments: str,
        limit: Callable[[], None] | None = None,
        **parameters: object,
    ) -> None:
        words = [sys.executable, "-m", *arguments]
        for name, value in parameters.items():
            words += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        self.process = subprocess.Popen(
            words,
            env={**environment, "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: _prepare(limit),
        )
        self.lines: list[tuple[float, str]] = []
        self._family: set[tuple[int, str]] = set()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def exit_status(self) -> int | None:
        """The exit status; None while it runs."""
        return self.process.poll()

    def children(self) -> list[int]:
        """Return the processes that it started, oldest first."""
        found: list[int] = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    fields = (entry / "stat").read_text().rpartition(")")[2].split()
                except OSError:
                    continue  # it ended meanwhile
                if int(fields[1]) == self.process.pid and fields[0] != "Z":
                    found.append(int(entry.name))
                    self._family.add((int(entry.name), fields[19]))
        return sorted(found)

    def send(self, number: int) -> None:
        """Send a signal to the node alone."""
        self.process.send_signal(number)

    def send_all(self, number: int) -> None:
        """Send a signal to its whole group, as a terminal does."""
        self.children()
        os.killpg(self.process.pid, number)

    def wait(self, timeout: float) -> float | None:
        """Wait for its end; return how long it took [s], or None."""
        began = time.monotonic()
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return None
        return time.monotonic() - began

    def text(self, since: float = 0.0) -> list[str]:
        """Return the lines of its terminal from a time on."""
        return [line for moment, line in list(self.lines) if moment >= since]

    def end(self) -> None:
        """Leave no process of it."""
        self.children()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        for pid, started in self._family:
            try:
                # A number that was given to another process meanwhile has another start.
                if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19] == started:
                    os.kill(pid, signal.SIGKILL)
            except (OSError, IndexError):
                pass  # it has ended
        self.process.wait(10.0)
        self._reader.join(1.0)

    def _read(self) -> None:
        for raw in self.process.stdout:
            self.lines.append((time.monotonic(), raw.decode("utf-8", "replace").rstrip()))


def prefer_devices() -> None:
    """Let devices and operator run before the bridge where the system allows it: they are the instruments."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, DEVICE_PRIORITY)
    except PermissionError:
        pass  # then they run with equal priority


def _prepare(limit: Callable[[], None] | None) -> None:
    if os.getpriority(os.PRIO_PROCESS, 0) < BRIDGE_PRIORITY:
        os.setpriority(os.PRIO_PROCESS, 0, BRIDGE_PRIORITY)
    if limit is not None:
        limit()

"""A hostile pressure controller on a pseudo terminal: the line protocol of the serial link, and its abuse."""

from __future__ import annotations

import errno
import os
import pty
import random
import select
import threading
import time
import tty
from pathlib import Path
from typing import Any

from chambers import Chambers

FAULTS = (
    "no acknowledgements",
    "wrong checksum",
    "400 digits",
    "refuses",
    "endless line",
    "garbage",
    "echo",
    "stuck status",
    "silent",
    "above limit",
    "other read-back",
    "not a number",
    "ignores",
)
_PERIOD = 0.01


class SerialDevice:
    """Speaks on a pseudo terminal, whose path is a link in a folder, until `close`.

    Args:
        folder: Folder of the link to the terminal.

    Attributes:
        chambers: The chambers.
        fault: Present fault; '' for none.
        away: It is unplugged.
        drift: The reports lag by this many seconds per second from `drift_from`.
    """

    def __init__(self, folder: Path) -> None:
        self.chambers = Chambers()
        self.path = folder / "tty"
        self.fault, self.away = "", False
        self.drift, self.drift_from = 0.0, 0.0
        self._random = random.Random(4)
        self._number = 0
        self._ending = threading.Event()
        self._master = -1
        self._plug()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def link(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        return {"type": "serial", "port": str(self.path), "baud": 115200, "unit": "mbar"}

    def break_answers(self, fault: str, count: int | None = None) -> None:
        """Misbehave in one way until `heal`; a count of lines is not kept."""
        assert fault in FAULTS, fault
        self.fault = fault

    def heal(self) -> None:
        """Work as it should."""
        self.fault, self.drift = "", 0.0

    def refuse(self) -> None:
        """Vanish, as a pulled USB plug."""
        self.away = True
        master, self._master = self._master, -1
        if master >= 0:
            os.close(master)
            os.close(self._slave)
        self.path.unlink(missing_ok=True)

    def listen(self) -> None:
        """Appear again."""
        self.away = False
        self._plug()

    def say(self, data: bytes) -> None:
        """Send bytes, in pieces that the terminal takes."""
        while data:
            try:
                data = data[os.write(self._master, data[:1024]) :]
            except BlockingIOError:
                return

    def close(self) -> None:
        """End it."""
        self._ending.set()
        self._thread.join(2.0)
        self.refuse()

    def _plug(self) -> None:
        master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))
        self._master = master

    def _run(self) -> None:
        waiting, due = b"", time.monotonic()
        while not self._ending.is_set():
            master = self._master
            if master < 0:
                time.sleep(_PERIOD)
                continue
            try:
                ready, _, _ = select.select([master], [], [], max(0.0, due - time.monotonic()))
                if ready:
                    *lines, waiting = (waiting + os.read(master, 4096)).split(b"\n")
                    for raw in lines:
                        self._take(master, raw)
                if time.monotonic() >= due:
                    due = max(due + _PERIOD, time.monotonic() - 0.1)
                    self._report(master)
            except (OSError, ValueError):
                waiting = b""

    def _take(self, master: int, raw: bytes) -> None:
        if self.fault == "echo":
            self._write(master, raw + b"\n")
        text, _, told = raw.decode("ascii", "replace").rpartition("*")
        if told != f"{_checksum(text):02X}":
            return
        kind, number, *values = text.split()
        if kind != "P" or len(values) != 2:
            return
        self.chambers.ask(*map(float, values), obey=self.fault not in ("refuses", "ignores"))
        if self.fault in ("no acknowledgements", "silent"):
            return
        if self.fault == "refuses":
            self._write(master, line(f"E {number} {self._milliseconds()} out_of_range"))
        else:
            self._write(master, line(f"A {number} {self._milliseconds()}"))

    def _report(self, master: int) -> None:
        fault = self.fault
        if fault == "silent":
            return
        if fault != "stuck status":
            self._number += 1
            now = time.monotonic()
            age = self.drift * (now - self.drift_from) if self.drift else 0.0
            pressures = list(self.chambers.pressure(now - age) if age else self.chambers.pressure())
            setpoints = [
                value + (300.0 if fault == "other read-back" else 0.0) for value in self.chambers.setpoint()
            ]
            if fault == "above limit":
                pressures[0] = 1950.0
            shown = [f"{value:.3f}" for value in (*setpoints, *pressures)]
            if fault == "400 digits":
                shown[2] = "9" * 400
            elif fault == "not a number":
                shown[2:] = ["nan", "inf"]
            self._last = f"S {self._number} {self._milliseconds(age)} {' '.join(shown)}"
        data = line(self._last)
        if fault == "wrong checksum":
            data = data[:-3] + b"ZZ\n"
        elif fault == "endless line":
            data = b"7" * 512
        elif fault == "garbage":
            data = self._random.randbytes(60)
        self._write(master, data)

    def _milliseconds(self, age: float = 0.0) -> int:
        return int((time.monotonic() - self.chambers.start - age) * 1e3) + 5000

    def _write(self, master: int, data: bytes) -> None:
        try:
            os.write(master, data)
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise  # a full terminal drops the line, as a real one does


def _checksum(text: str) -> int:
    total = 0
    for byte in text.encode("ascii", "replace"):
        total ^= byte
    return total


def line(text: str) -> bytes:
    """Return a line of the protocol: text, checksum, newline."""
    return f"{text}*{_checksum(text):02X}\n".encode("ascii", "replace")

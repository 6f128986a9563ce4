"""The mock rig as a pressure controller at the other end of a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
from collections import deque
from typing import Any

from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.rig.output import line_protocol
from ldcs_ros.rig.units import PressureUnit

_MBAR = PressureUnit("mbar")


class SerialPort:
    """A serial line by the line protocol: a bridge opens its pseudo-terminal like any other.

    Args:
        rig: The rig.

    Attributes:
        name: Device file for the bridge.
    """

    def __init__(self, rig: MockRig) -> None:
        self._rig = rig
        self._buffer = line_protocol.LineBuffer()
        self._last = 0
        self._answers: deque[tuple[float, bytes]] = deque()
        self.name = ""
        self._near_end = self._far_end = -1

    def start(self) -> None:
        """Open the pseudo-terminal."""
        # Windows has neither this module nor pseudo-terminals.
        import tty

        self._near_end, self._far_end = os.openpty()
        tty.setraw(self._far_end)
        os.set_blocking(self._near_end, False)
        self.name = os.ttyname(self._far_end)

    def stop(self) -> None:
        """Close it: the bridge's end is gone, too."""
        for descriptor in (self._near_end, self._far_end):
            if descriptor >= 0:
                with contextlib.suppress(OSError):
                    os.close(descriptor)
        self._near_end = self._far_end = -1

    def describe(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        return {"type": "serial", "port": self.name, "rate": 100.0, "unit": "mbar"}

    def work(self) -> None:
        """Take commands, send what is due; called about as often as the rig reports."""
        if self._rig.faults.drop:
            self.stop()
        if self._near_end < 0:
            return
        for raw in self._buffer.feed(self._read()):
            with contextlib.suppress(ValueError, IndexError, UnicodeDecodeError):
                self._take(line_protocol.fields(raw))
        now = self._rig.rig_time()
        while self._answers and self._answers[0][0] <= now:
            self._write(self._answers.popleft()[1])
        for status in self._rig.statuses(self._last):
            self._last = max(self._last, status.number)
            pressures = [_MBAR.from_pascal(value) for value in (*status.setpoint, *status.pressure)]
            self._write(line_protocol.line("S", status.number, int(status.stamp * 1e3), *pressures))

    def _take(self, fields: list[str]) -> None:
        if fields[0] != "P":
            return
        refused = self._rig.command([_MBAR.to_pascal(float(text)) for text in fields[2:]])
        faults, stamp = self._rig.faults, self._rig.rig_time()
        rest = (
            ("E", fields[1], int(stamp * 1e3), refused.replace(" ", "-"))
            if refused
            else ("A", fields[1], int(stamp * 1e3))
        )
        if not faults.mute:
            self._answers.append((stamp + faults.delay, line_protocol.line(*rest)))

    def _read(self) -> bytes:
        try:
            return os.read(self._near_end, 65536)
        except (BlockingIOError, OSError):
            return b""

    def _write(self, data: bytes) -> None:
        # A full terminal has no reader: the excess is lost, as on a wire.
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self._near_end, data)

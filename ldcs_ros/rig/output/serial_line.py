"""A pressure controller on a serial line, by the line protocol."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ldcs_ros.errors import LinkError
from ldcs_ros.rig.limits import Pressures
from ldcs_ros.rig.output import line_protocol
from ldcs_ros.rig.output.device import Device, missing_package
from ldcs_ros.rig.units import PressureUnit

if TYPE_CHECKING:
    from serial import Serial

_LONGEST_NUMBER = 15
_MOST_UNANSWERED = 200


@dataclass(frozen=True)
class SerialSettings:
    """The settings of a serial line.

    Attributes:
        port: Device file, for example /dev/ttyUSB0.
        baud: Bits per second.
        rate: Exchanges per second [Hz].
        unit: Unit of the pressures in the lines.
    """

    port: str
    baud: int = 115200
    rate: float = 100.0
    unit: PressureUnit = PressureUnit("mbar")


class SerialDevice(Device):
    """A controller that sends status lines as they come, and takes set-points; without them nothing is written."""

    def __init__(self, settings: SerialSettings, arms: tuple[str, ...], clock: Callable[[], float]) -> None:
        super().__init__("serial", clock, settings.rate, 1e-3 * settings.unit.step)
        self._settings, self._arms = settings, arms
        self._port: Serial | None = None
        self._buffer = line_protocol.LineBuffer()
        self._unanswered: dict[int, float] = {}

    def open(self) -> None:
        try:
            import serial
        except ImportError as error:
            raise LinkError(missing_package("a serial line", "pyserial")) from error

        try:
            self._port = serial.Serial(
                self._settings.port, self._settings.baud, timeout=0.0, write_timeout=0.1, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise LinkError(f"cannot open the serial line {self._settings.port}: {error}") from error
        self._buffer = line_protocol.LineBuffer()

    def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            # A device that went away leaves nothing to close.
            with contextlib.suppress(OSError):
                port.close()

    def exchange(self, setpoint: Pressures | None) -> None:
        import serial

        port = self._port
        if port is None:
            raise LinkError("the serial line is not open")
        try:
            if setpoint is not None:
                port.write(self._line(setpoint))
            data = port.read(port.in_waiting)
        except (serial.SerialException, OSError) as error:
            raise LinkError(f"the serial line {self._settings.port} is gone: {error}") from error
        for raw in self._buffer.feed(data):
            self.record(raw + b"\n", sent=False)
            try:
                self._take(line_protocol.fields(raw))
            except (ValueError, IndexError, OverflowError):
                self.malformed += 1

    def _line(self, setpoint: Pressures) -> bytes:
        self.heartbeats += 1
        # Three decimals, cut off, not rounded: a set-point must not leave above its limit.
        values = [int(self._settings.unit.from_pascal(value) * 1e3) / 1e3 for value in setpoint]
        data = line_protocol.line("P", self.heartbeats, *values)
        self._unanswered[self.heartbeats] = self.clock()
        if len(self._unanswered) > _MOST_UNANSWERED:
            del self._unanswered[min(self._unanswered)]
        self.record(data, sent=True)
        return data

    def _take(self, fields: list[str]) -> None:
        if max(map(len, fields[1:])) > _LONGEST_NUMBER and fields[0] != "E":
            raise ValueError("a number has too many digits")
        kind, number, stamp = fields[0], int(fields[1][:20]), int(fields[2][:20]) * 1e-3
        if kind == "S":
            values, n = [float(text) for text in fields[3:]], len(self._arms)
            if len(values) != 2 * n:
                raise ValueError(f"got a status of {len(values)} pressures, expected {2 * n}")
            pascals = [self._settings.unit.to_pascal(value) for value in values]
            for arm, setting, actual in zip(self._arms, pascals[:n], pascals[n:], strict=True):
                self.report("pressure_command", arm, setting, stamp=stamp)
                self.report("pressure", arm, actual, stamp=stamp)
            return
        if kind not in ("A", "E"):
            raise ValueError(f"unknown line {kind!r}")
        sent = self._unanswered.pop(number, None)
        if sent is None:
            return
        self.round_trip(sent, stamp, self.clock())
        if kind == "A":
            self.acknowledge()
        else:
            self.refuse(" ".join(fields[3:])[:80])

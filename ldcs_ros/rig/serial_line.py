"""A pressure controller on a serial line, by the line protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import LinkError
from ldcs_ros.rig import line_protocol
from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.link import Link
from ldcs_ros.rig.reading import ARM_NAMES
from ldcs_ros.rig.units import PressureUnit

_MOST_UNANSWERED = 200


@dataclass(frozen=True)
class SerialSettings:
    """How a controller is connected.

    Attributes:
        port: Device file, for example /dev/ttyUSB0.
        baud: Bits a second.
        rate: Exchanges a second [Hz].
        unit: Unit of the pressures in the lines.
    """

    port: str
    baud: int = 115200
    rate: float = 100.0
    unit: PressureUnit = PressureUnit("mbar")


class SerialLink(Link):
    """Reads status lines as they come, and writes set-points when there are any; in shadow it writes nothing."""

    def __init__(self, settings: SerialSettings, limits: Limits, clock: Callable[[], float]) -> None:
        super().__init__("serial", limits, clock, settings.rate)
        self._settings = settings
        self._port: Any = None
        self._buffer = line_protocol.LineBuffer()
        self._unanswered: dict[int, float] = {}
        self.clock_estimate = ClockEstimate()
        self.refusals = 0

    def open(self) -> None:
        import serial

        try:
            self._port = serial.Serial(
                self._settings.port, self._settings.baud, timeout=0.0, write_timeout=0.1, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise LinkError(f"cannot open the serial line {self._settings.port}: {error}") from error
        self._buffer = line_protocol.LineBuffer()

    def close(self) -> None:
        if self._port is not None:
            try:
                self._port.close()
            except OSError:
                pass  # the device went away: there is nothing left to close
            self._port = None

    def exchange(self, setpoint: np.ndarray | None) -> None:
        import serial

        try:
            if setpoint is not None:
                self._send(setpoint)
            data = self._port.read(self._port.in_waiting)
        except (serial.SerialException, OSError) as error:
            raise LinkError(f"the serial line {self._settings.port} is gone: {error}") from error
        for raw in self._buffer.feed(data):
            self.record(raw + b"\n", sent=False)
            try:
                self._take(line_protocol.fields(raw))
            except (ValueError, IndexError):
                self.malformed += 1

    def _send(self, setpoint: np.ndarray) -> None:
        self.beats += 1
        # Three decimals, cut off, not rounded: a set-point must not leave above its limit.
        values = [int(self._settings.unit.from_pascal(float(value)) * 1e3) / 1e3 for value in setpoint]
        data = line_protocol.line("P", self.beats, *values)
        self._unanswered[self.beats] = self.clock()
        if len(self._unanswered) > _MOST_UNANSWERED:
            del self._unanswered[min(self._unanswered)]
        self.record(data, sent=True)
        self._port.write(data)

    def _take(self, fields: list[str]) -> None:
        kind, number, stamp = fields[0], int(fields[1]), int(fields[2]) * 1e-3
        if kind == "S":
            values = [float(text) for text in fields[3:7]]
            if len(values) != 2 * len(ARM_NAMES):
                raise ValueError("a status has four pressures")
            pascals = [np.array(self._settings.unit.to_pascal(value)) for value in values]
            for arm, setting, actual in zip(ARM_NAMES, pascals[:2], pascals[2:], strict=True):
                self.report("pressure_command", arm, setting, stamp=stamp)
                self.report("pressure", arm, actual, stamp=stamp)
            return
        sent = self._unanswered.pop(number, None)
        if sent is not None and self.clock_estimate is not None:
            self.clock_estimate.round_trip(sent, stamp, self.clock())
        if kind == "E":
            self.refusals += 1
        elif kind != "A":
            raise ValueError(f"unknown line {kind!r}")

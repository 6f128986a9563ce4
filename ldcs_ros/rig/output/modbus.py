"""A valve island by Modbus TCP: set-points in holding registers, measured pressures in input registers."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ldcs_ros.errors import LinkError
from ldcs_ros.rig.limits import Limits, Pressures
from ldcs_ros.rig.output.device import Device, missing_package
from ldcs_ros.rig.units import PressureUnit

_HIGHEST_REGISTER = 0x7FFF  # above it some islands read a negative number
_MILLISECONDS_A_TURN = 2**32


class ModbusClient(Protocol):
    """A client of pymodbus, which has requests such as `read_holding_registers` beside these."""

    def connect(self) -> bool:
        """Connect; return whether that worked."""

    def close(self) -> None:
        """Disconnect."""


class ModbusAnswer(Protocol):
    """An answer of pymodbus."""

    registers: list[int]

    def isError(self) -> bool:  # noqa: N802  # the name of pymodbus
        """Return whether the device refused the request."""


@dataclass(frozen=True)
class ModbusMap:
    """A map of the registers of a valve island.

    Attributes:
        host: Its address.
        port: TCP port.
        device: Device (unit) identifier.
        rate: Exchanges per second [Hz].
        timeout: Longest wait for an answer [s].
        unit: Unit of the registers; the pressures in them are whole numbers.
        setpoint: Holding register of the first arm's set-point; those of the other arms follow in their order.
        actual: Input register of the first arm's measured pressure, signed; the others follow.
        clock: Input registers with milliseconds since some start, high word first; -1 for none.
        heartbeat: Holding register that is counted up with every write; -1 for none.
    """

    host: str
    port: int = 502
    device: int = 1
    rate: float = 50.0
    timeout: float = 0.2
    unit: PressureUnit = PressureUnit("mbar")
    setpoint: int = 0
    actual: int = 0
    clock: int = -1
    heartbeat: int = -1


class ModbusDevice(Device):
    """A valve island that is polled, and written when there are set-points.

    A written number never exceeds the asked one.
    """

    def __init__(self, registers: ModbusMap, limits: Limits, clock: Callable[[], float]) -> None:
        super().__init__("modbus", clock, registers.rate, registers.unit.step)
        self._map = registers
        self._client: ModbusClient | None = None
        self._arms = limits.arms
        self._highest = [
            min(int(registers.unit.from_pascal(pressure)), _HIGHEST_REGISTER) for pressure in limits.highest
        ]

    def open(self) -> None:
        try:
            from pymodbus.client import ModbusTcpClient
        except ImportError as error:
            raise LinkError(missing_package("Modbus TCP", "pymodbus")) from error

        # Its own log would repeat every failed attempt; the diagnostics say it once per second.
        logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
        client: ModbusClient = ModbusTcpClient(
            self._map.host,
            port=self._map.port,
            timeout=self._map.timeout,
            retries=0,
            trace_packet=self._trace,
        )
        self._client = client
        if not client.connect():
            raise LinkError(
                f"no valve island answers at {self._map.host}:{self._map.port}; is it switched on?"
            )

    def close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def exchange(self, setpoint: Pressures | None) -> None:
        if setpoint is not None:
            self._write(setpoint)
        registers = self._map
        setpoints = self._read("read_holding_registers", registers.setpoint, len(self._arms))
        actual = self._read("read_input_registers", registers.actual, len(self._arms))
        stamp = None
        if registers.clock >= 0:
            sent = self.clock()
            high, low = self._read("read_input_registers", registers.clock, 2)
            stamp = ((high << 16 | low) % _MILLISECONDS_A_TURN) * 1e-3
            self.round_trip(sent, stamp, self.clock())
        for name, setting, pressure in zip(self._arms, setpoints, actual, strict=True):
            self.report("pressure_command", name, self._pascal(setting), stamp=stamp)
            self.report("pressure", name, self._pascal(pressure), stamp=stamp)

    def _write(self, setpoint: Pressures) -> None:
        # Rounded down: rounding must not lift a set-point over its limit.
        values = [int(self._map.unit.from_pascal(value)) for value in setpoint]
        values = [min(max(value, 0), most) for value, most in zip(values, self._highest, strict=True)]
        self._ask("write_registers", self._map.setpoint, values)
        self.acknowledge()
        self.heartbeats += 1
        if self._map.heartbeat >= 0:
            self._ask("write_register", self._map.heartbeat, self.heartbeats & 0xFFFF)

    def _read(self, request: str, address: int, count: int) -> list[int]:
        registers = list(self._ask(request, address, count=count).registers)
        if len(registers) != count:
            raise LinkError(
                f"the valve island answers {request} at register {address} "
                f"with {len(registers)} registers, expected {count}"
            )
        return registers

    def _ask(self, request: str, *arguments: object, **keywords: object) -> ModbusAnswer:
        from pymodbus.exceptions import ModbusException

        try:
            answer: ModbusAnswer = getattr(self._client, request)(
                *arguments, device_id=self._map.device, **keywords
            )
        except (ModbusException, OSError) as error:
            raise LinkError(f"the valve island does not answer: {str(error).splitlines()[0]}") from error
        if answer.isError():
            raise LinkError(f"the valve island refuses {request} at register {arguments[0]}: {answer}")
        return answer

    def _pascal(self, register: int) -> float:
        signed = register - 0x10000 if register > _HIGHEST_REGISTER else register
        return self._map.unit.to_pascal(float(signed))

    def _trace(self, sending: bool, data: bytes) -> bytes:
        if data:
            self.record(data, sent=sending)
        return data

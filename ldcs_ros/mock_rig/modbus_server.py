"""The mock rig as a Modbus TCP valve island on the loopback interface."""

from __future__ import annotations

import asyncio
import logging
import math
import threading
from typing import TYPE_CHECKING, Any, Protocol, cast

from ldcs_ros.errors import LinkError
from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.rig.units import PressureUnit
from ldcs_ros.schema.units import MAX_ARMS

if TYPE_CHECKING:
    from pymodbus.constants import ExcCodes

_READ_HOLDING, _READ_INPUT, _WRITE_ONE, _WRITE_MANY = 3, 4, 6, 16
_BROKEN_SENSOR = 0x7FFF
_MBAR = PressureUnit("mbar")
_UNANSWERED = 3600.0
_MOST_REGISTERS = MAX_ARMS + 2


class _Server(Protocol):
    async def shutdown(self) -> None: ...


class ModbusServer:
    """Serves a rig's registers; its faults act as they would on the wire.

    Holding registers: the set-points of the n arms from 0 on, the heartbeat at n. Input registers: the measured
    pressures from 0 on, the clock at n and n + 1.

    Args:
        rig: The rig.
        port: TCP port; 0 for any free one.

    Attributes:
        port: The port it listens on, known after `start`.
        heartbeats: Last heartbeat written by a client.
    """

    def __init__(self, rig: MockRig, port: int = 0) -> None:
        self._rig = rig
        self._n_arms = len(rig.simulation.arm_names)
        self.port = port
        self.heartbeats = 0
        self._loop = asyncio.new_event_loop()
        self._server: _Server | None = None
        self._stopping = False
        self._ready = threading.Event()
        self._problem: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="modbus server", daemon=True)

    def start(self) -> None:
        """Start serving; raises LinkError when the port cannot be had."""
        logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
        self._thread.start()
        self._ready.wait(5.0)
        if self._problem is not None:
            raise LinkError(
                f"cannot serve Modbus TCP on port {self.port}: {self._problem}"
            ) from self._problem

    def stop(self) -> None:
        """Stop serving."""
        self._stopping = True
        self._thread.join(3.0)

    def work(self) -> None:
        """Nothing to do between requests: the server has a thread of its own."""

    def describe(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        link: dict[str, Any] = {"type": "modbus", "host": "127.0.0.1", "port": self.port, "rate": 50.0}
        return {
            **link,
            "unit": "mbar",
            "setpoint": 0,
            "actual": 0,
            "clock": self._n_arms,
            "heartbeat": self._n_arms,
        }

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as error:  # whatever it is, `start` raises it
            self._problem = error
        finally:
            self._ready.set()
            self._loop.close()

    async def _serve(self) -> None:
        await self._listen()
        self._ready.set()
        while not self._stopping:
            if self._rig.faults.drop and self._server is not None:
                await self._server.shutdown()
                self._server = None
            elif not self._rig.faults.drop and self._server is None:
                await self._listen()
            await asyncio.sleep(0.02)
        if self._server is not None:
            await self._server.shutdown()
        waiting = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)

    async def _listen(self) -> None:
        from pymodbus.server import ModbusTcpServer
        from pymodbus.simulator import DataType, SimData, SimDevice

        bits = [SimData(0, values=False, datatype=DataType.BITS)]
        words = [SimData(0, values=0, count=_MOST_REGISTERS, datatype=DataType.REGISTERS)]
        more = [SimData(0, values=0, count=_MOST_REGISTERS, datatype=DataType.REGISTERS)]
        device = SimDevice(1, simdata=(bits, list(bits), words, more), action=self._act)
        server = ModbusTcpServer(device, address=("127.0.0.1", self.port))
        await server.serve_forever(background=True)
        self.port = cast(asyncio.Server, server.transport).sockets[0].getsockname()[1]
        self._server = server

    async def _act(
        self,
        function: int,
        start: int,
        address: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        faults = self._rig.faults
        if values is not None and function in (_WRITE_ONE, _WRITE_MANY):
            refusal = self._written(address, [int(value) for value in values])
            if refusal is not None:
                return refusal
        if faults.mute:
            await asyncio.sleep(_UNANSWERED)
        if faults.delay > 0.0:
            await asyncio.sleep(faults.delay)
        shown = self._holding() if function == _READ_HOLDING else self._input()
        if values is None:
            for place, value in enumerate(shown):
                registers[place - start] = value
        return None

    def _written(self, address: int, values: list[int]) -> ExcCodes | None:
        from pymodbus.constants import ExcCodes

        if address == self._n_arms:
            self.heartbeats = values[0]
            return None
        signed = [value - 0x10000 if value > _BROKEN_SENSOR else value for value in values]
        if address != 0 or len(signed) != self._n_arms:
            return ExcCodes.ILLEGAL_ADDRESS
        refused = self._rig.command([_MBAR.to_pascal(float(value)) for value in signed])
        return ExcCodes.ILLEGAL_VALUE if refused else None

    def _holding(self) -> list[int]:
        return [*(round(_MBAR.from_pascal(value)) for value in self._rig.setpoint), self.heartbeats]

    def _input(self) -> list[int]:
        status = self._rig.latest()
        actual = [
            _BROKEN_SENSOR if math.isnan(value) else round(_MBAR.from_pascal(value)) & 0xFFFF
            for value in status.pressure
        ]
        milliseconds = int(status.stamp * 1e3) % 2**32
        return [*actual, milliseconds >> 16, milliseconds & 0xFFFF]

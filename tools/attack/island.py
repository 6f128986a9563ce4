"""A hostile valve island: raw Modbus TCP on loopback, no watchdog, and every misbehaviour that a switch can select.

Holding registers 0, 1 are the set-points, input registers 0, 1 the measured pressures [mbar, signed], input
registers 10, 11 a clock [ms, high word first]; holding register 2 is a heartbeat.
"""

from __future__ import annotations

import os
import random
import socket
import struct
import threading
import time
from typing import Any

from chambers import Chambers

# Answers that are wrong although the device works on.
WRONG_ANSWERS = (
    "one register",
    "five registers",
    "odd byte count",
    "other function",
    "exception",
    "other transaction",
    "other unit",
    "random bytes",
    "random answers",
)
# Misbehaviour of the device itself.
FAULTS = (
    *WRONG_ANSWERS,
    "truncated",
    "split",
    "delayed",
    "silent",
    "closed in the middle",
    "refuses writes",
    "ignores writes",
    "other read-back",
    "above limit",
    "works to 1950 mbar",
    "not a number",
    "clock stuck",
    "clock jumps",
)


class Island:
    """Serves one TCP port until `close`.

    Args:
        seed: Seed of what is random.

    Attributes:
        chambers: The chambers.
        answered: Number of answers.
        fault: Present fault; '' for none.
        away: It is unplugged.
        remaining: Answers that the fault still spoils; None for all.
        delay: Added to each answer with the fault 'delayed' [s].
        drift: The measured values lag by this many seconds per second from `drift_from`.
    """

    def __init__(self, seed: int = 3) -> None:
        self.chambers = Chambers()
        self.fault, self.remaining, self.delay = "", None, 0.1
        self.away = False
        self.answered = 0
        self.drift, self.drift_from = 0.0, 0.0
        self._random = random.Random(seed)
        self._connections: list[socket.socket] = []
        self._ending = threading.Event()
        self._server: socket.socket | None = None
        self.port = 0
        self.listen()

    def link(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        return {
            "type": "modbus",
            "host": "127.0.0.1",
            "port": self.port,
            "device": 1,
            "rate": 50.0,
            "timeout": 0.1,
            "unit": "mbar",
            "setpoint": 0,
            "actual": 0,
            "clock": 10,
            "heartbeat": 2,
        }

    def listen(self) -> None:
        """Accept connections, on the same port as before."""
        self.away = False
        server = socket.create_server(("127.0.0.1", self.port))
        self.port = server.getsockname()[1]
        self._server = server
        threading.Thread(target=self._accept, args=(server,), daemon=True).start()

    def refuse(self) -> None:
        """Close every connection and accept none, as after a pulled cable or a switched-off device."""
        self.away = True
        server, self._server = self._server, None
        if server is not None:
            server.shutdown(socket.SHUT_RDWR)
            server.close()
        for connection in list(self._connections):
            _close(connection)

    def close(self) -> None:
        """End it."""
        self._ending.set()
        self.refuse()

    def break_answers(self, fault: str, count: int | None = None) -> None:
        """Let the next answers be spoilt; all of them without a count."""
        assert fault in FAULTS, fault
        self.remaining, self.fault = count, fault

    def heal(self) -> None:
        """Work as it should."""
        self.fault, self.remaining, self.drift = "", None, 0.0

    def _accept(self, server: socket.socket) -> None:
        while not self._ending.is_set():
            try:
                connection, _ = server.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            while True:
                head = _exactly(connection, 7)
                transaction, _, length, unit = struct.unpack(">HHHB", head)
                request = _exactly(connection, length - 1)
                self._answer(connection, transaction, unit, request)
        except (OSError, EOFError, struct.error):
            pass  # the bridge has gone
        finally:
            _close(connection)
            if connection in self._connections:
                self._connections.remove(connection)

    def _take_fault(self) -> str:
        fault = self.fault
        if fault and self.remaining is not None:
            self.remaining -= 1
            if self.remaining <= 0:
                self.fault, self.remaining = "", None
        return fault

    def _answer(self, connection: socket.socket, transaction: int, unit: int, request: bytes) -> None:
        fault = self._take_fault()
        if fault == "silent":
            return
        self.answered += 1
        answer = self._work(request, fault)
        function = request[0]
        reads = function in (3, 4)
        if fault == "one register":
            answer = bytes([function, 2]) + answer[2:4] if reads else answer[:3]
        elif fault == "five registers":
            answer = bytes([function, 10]) + bytes(10) if reads else answer + bytes(6)
        elif fault == "odd byte count":
            answer = bytes([function, 3]) + bytes(3) if reads else answer[:4]
        elif fault == "other function":
            answer = bytes([1 if function != 1 else 2, 1, 0])
        elif fault == "exception":
            answer = bytes([function | 0x80, 4])
        elif fault == "other transaction":
            transaction = (transaction + 7) & 0xFFFF
        elif fault == "other unit":
            unit = (unit + 5) & 0xFF
        elif fault == "random answers":
            answer = self._random_answer(request)
        elif fault == "delayed":
            time.sleep(self.delay)
        data = struct.pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer
        if fault == "random bytes":
            data = self._random.randbytes(self._random.randint(1, 40))
        elif fault == "truncated":
            data = data[:-1]
        elif fault == "closed in the middle":
            connection.sendall(data[: len(data) // 2])
            _close(connection)
            return
        elif fault == "split":
            for one in data:
                connection.sendall(bytes([one]))
                time.sleep(0.001)
            return
        connection.sendall(data)

    def _random_answer(self, request: bytes) -> bytes:
        """Return an answer in a valid frame: function, byte count and registers are right or random."""
        source = self._random
        function = source.choice((request[0], request[0], request[0], source.randrange(1, 256)))
        payload = source.randbytes(source.choice((0, 1, 2, 3, 4, 4, 4, 8, 10, 250)))
        count = source.choice((len(payload), len(payload), source.randrange(256)))
        return bytes([function, count]) + payload

    def _work(self, request: bytes, fault: str) -> bytes:
        function = request[0]
        address, count = struct.unpack(">HH", request[1:5])
        if function in (3, 4):
            table = self._holding(fault) if function == 3 else self._input(fault)
            values = [int(table.get(address + k, 0)) & 0xFFFF for k in range(count)]
            return bytes([function, 2 * count]) + struct.pack(f">{count}H", *values)
        if function == 16:
            values = struct.unpack(f">{count}H", request[6 : 6 + 2 * count])
            refused = fault == "refuses writes"
            if address == 0 and count == 2:
                asked = [_signed(value) for value in values]
                self.chambers.ask(*asked, obey=fault not in ("refuses writes", "ignores writes"))
                if fault == "works to 1950 mbar" and max(asked) > 0.0:
                    self.chambers.work_to(1950.0, 1950.0)
            return bytes([function | 0x80, 4]) if refused else request[:5]
        if function == 6:
            if address in (0, 1):
                held = list(self.chambers.setpoint())
                held[address] = _signed(count)
                self.chambers.ask(*held)
            return request[:5]
        return bytes([function | 0x80, 1])

    def _holding(self, fault: str) -> dict[int, float]:
        left, right = self.chambers.setpoint()
        extra = 300.0 if fault == "other read-back" else 0.0
        return {0: left + extra, 1: right + extra}

    def _input(self, fault: str) -> dict[int, float]:
        now = time.monotonic()
        age = self.drift * (now - self.drift_from) if self.drift else 0.0
        left, right = self.chambers.pressure(now - age) if age else self.chambers.pressure()
        if fault == "above limit":
            left = 1950.0
        elif fault == "not a number":
            left, right = -32768.0, 32767.0
        milliseconds = int((now - self.chambers.start - age) * 1e3) + 5000
        if fault == "clock stuck":
            milliseconds = 4000
        elif fault == "clock jumps":
            milliseconds = self._random.randrange(2**32)
        return {0: left, 1: right, 10: milliseconds >> 16, 11: milliseconds & 0xFFFF}


def _signed(register: int) -> float:
    return float(register - 0x10000 if register > 0x7FFF else register)


def _exactly(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise EOFError
        data += part
    return data


def _close(connection: socket.socket) -> None:
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass  # it is closed already
    connection.close()


if __name__ == "__main__":
    island = Island()
    print(f"{os.getpid()}: a hostile valve island listens on 127.0.0.1:{island.port}", flush=True)
    threading.Event().wait()

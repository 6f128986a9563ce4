"""The process of the output stage: a socket to the bridge on one side, the device on the other."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable
from typing import Any

from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.device import Device
from ldcs_ros.rig.output.modbus import ModbusDevice, ModbusMap
from ldcs_ros.rig.output.serial_line import SerialDevice, SerialSettings
from ldcs_ros.rig.output.stage import ORPHAN_PATIENCE, RETRY_PERIOD, OutputStage
from ldcs_ros.rig.units import PressureUnit

UNCONFIRMED = 3
"""Exit status when the rig confirmed no zero."""
# Windows has the first one alone.
IGNORED = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGPIPE")
    if hasattr(signal, name)
)
_LONGEST_WAIT = 0.05

Settings = dict[str, Any]


class MessageSocket:
    """JSON lines over a socket; messages that the other side does not fetch are dropped.

    Attributes:
        lost: Whether the other side is gone.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._socket.setblocking(False)
        self._received = b""
        self._pending = b""
        self._kept: list[dict[str, Any]] = []
        self.lost = False

    def fileno(self) -> int:
        """Return the file descriptor, for select."""
        return self._socket.fileno()

    def receive(self) -> list[dict[str, Any]]:
        """Return the whole messages that have come, oldest first; never blocks."""
        kept, self._kept = self._kept, []
        while True:
            try:
                data = self._socket.recv(1 << 16)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if not data:
                self.lost = True
                break
            self._received += data
        *lines, self._received = self._received.split(b"\n")
        return kept + [json.loads(line) for line in lines if line]

    def put_back(self, messages: list[dict[str, Any]]) -> None:
        """Keep messages for the next `receive`."""
        self._kept = messages

    def send(self, message: dict[str, Any]) -> None:
        """Send a message, or drop it while an earlier one is still on its way."""
        self._flush()
        if not self._pending and not self.lost:
            self._pending = json.dumps(message).encode() + b"\n"
            self._flush()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _flush(self) -> None:
        while self._pending:
            try:
                self._pending = self._pending[self._socket.send(self._pending) :]
            except BlockingIOError:
                return
            except OSError:
                self._pending, self.lost = b"", True


def wire_device(kind: str, settings: Settings, limits: Limits, clock: Callable[[], float]) -> Device:
    """Return the device of a rig file's Modbus or serial link."""
    unit = PressureUnit(**settings.pop("unit"))
    if kind == "modbus":
        return ModbusDevice(ModbusMap(**settings, unit=unit), limits, clock)
    return SerialDevice(SerialSettings(**settings, unit=unit), limits.arms, clock)


def serve(make: Callable[[str, Settings, Limits, Callable[[], float]], Device]) -> int:
    """Run the stage that the first message describes, until zero is confirmed or patience ends.

    The first argument of the process is the number of the inherited socket. A standby process waits with
    everything loaded, so that it vents at once when the process before it is lost.

    Args:
        make: Makes the device of a kind from settings, limits and a steady clock.

    Returns:
        0 after a confirmed zero, or where nothing was ever to be written; UNCONFIRMED otherwise.
    """
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    terminated: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: terminated.append(number))
    # If permitted, the process that vents runs before those that compute.
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    channel = MessageSocket(socket.socket(fileno=int(sys.argv[1])))
    start = _first(channel, "link", terminated)
    if start is None:
        return 0
    limits = Limits(**{**start["limits"], "arms": tuple(start["limits"]["arms"])})
    device = make(start["link"], start["settings"], limits, time.monotonic)
    begin = _first(channel, "begin", terminated)
    if begin is None:
        return 0
    stage = OutputStage(device, limits, time.monotonic, commands=start["commands"])
    if begin["begin"] == "vent":
        stage.vent(begin["reason"], begin["epoch"])
    return _run(stage, channel, terminated)


def _first(channel: MessageSocket, key: str, terminated: list[int]) -> dict[str, Any] | None:
    """Return the first message with a key, or None when none can come any more."""
    while not terminated and not channel.lost:
        messages = channel.receive()
        for index, message in enumerate(messages):
            if key in message:
                channel.put_back(messages[index + 1 :])
                return message
        select.select([channel], [], [], 1.0)
    return None


def _run(stage: OutputStage, channel: MessageSocket, terminated: list[int]) -> int:
    due = time.monotonic()
    bridge = os.getppid()
    lost = False
    while not stage.ended:
        wait = min(max(due - time.monotonic(), 0.0), _LONGEST_WAIT)
        try:
            if lost:
                time.sleep(wait)
            else:
                select.select([channel], [], [], wait)
                for message in channel.receive():
                    _obey(stage, message)
            # A process that inherited the bridge's end of the socket keeps it open: the parent counts as well.
            gone = channel.lost or os.getppid() != bridge
            if not lost and (gone or terminated):
                lost = gone
                why = "the bridge is gone" if gone else "the output process received SIGTERM"
                stage.end(why, ORPHAN_PATIENCE)
                terminated.clear()
                if stage.commands and lost:
                    print_line(f"output: {why}; the arms are vented")
            now = time.monotonic()
            if now >= due:
                due = max(due + stage.step(), now)
                channel.send(stage.exchange().as_dict())
        except Exception as error:  # whatever it is: the process lives on and vents; the bridge reads why
            stage.vent(f"the output process failed: {error!r}")
            due = time.monotonic() + RETRY_PERIOD
    if lost and not stage.confirmed:
        holding = stage.monitor.holding() or "the arms may hold pressure"
        print_line(f"output: no zero was confirmed: {holding}; cut the supply")
    return 0 if stage.confirmed else UNCONFIRMED


def print_line(line: str) -> None:
    """Print a line to the terminal, which may be closed: that ends neither a vent nor a bridge."""
    with contextlib.suppress(OSError, ValueError):
        print(line, file=sys.stderr, flush=True)


def _obey(stage: OutputStage, message: dict[str, Any]) -> None:
    if "target" in message:
        stage.set_target(message["target"], message["epoch"], message["time"])
    elif "vent" in message:
        stage.vent(message["vent"], message["epoch"])
    elif "end" in message:
        stage.end(message["end"], message["patience"])

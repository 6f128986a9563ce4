"""`OutputLink`: the bridge's end of an output process; it starts, watches, replaces and ends the process."""

from __future__ import annotations

import dataclasses
import itertools
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.limits import Limits, Pressures
from ldcs_ros.rig.link import Link, RawPacket
from ldcs_ros.rig.output.modbus import ModbusMap
from ldcs_ros.rig.output.process import UNCONFIRMED, MessageSocket
from ldcs_ros.rig.output.serial_line import SerialSettings
from ldcs_ros.rig.output.stage import Exchange, OutputStatus
from ldcs_ros.rig.reading import RawReading
from ldcs_ros.rig.topic_link import TopicSettings

WIRE_PROGRAM = "ldcs_ros.rig.output"
_LOOK = 0.05
_LONGEST_SILENCE = 1.0  # s: an exchange with a device that answers late takes less
_LONGEST_START = 20.0  # s: a process that loads ROS on a busy machine takes less
_ENDING = 1.0  # s beyond the time of a vent, for the process to end
_MOST_ENDINGS = 2  # processes that are lost during the end and replaced


class _Process:
    """One output process and the channel to it."""

    def __init__(self, program: str, description: dict[str, Any]) -> None:
        ours, theirs = socket.socketpair()
        # A session of its own: Ctrl-C, a closed terminal and a lost ssh reach the bridge alone.
        self.process = subprocess.Popen(
            [sys.executable, "-m", program, str(theirs.fileno()), *_ros_arguments(sys.argv)],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()
        self.channel = MessageSocket(ours)
        self.channel.send(description)
        self.patience = _LONGEST_START
        self.silence = 0.0

    def begin(self, how: dict[str, Any]) -> None:
        """Let the standby process take the device."""
        self.channel.send(how)

    def kill(self) -> None:
        """End the process at once; a process that is stopped cannot vent, and the next one must have the device."""
        self.process.kill()
        self.process.wait()
        self.channel.close()

    def dismiss(self) -> None:
        """End a standby process, which never had the device."""
        self.channel.close()
        try:
            self.process.wait(2.0)
        except subprocess.TimeoutExpired:
            self.kill()


def _ros_arguments(words: list[str]) -> list[str]:
    """Return the ROS arguments of this process that hold for the output process: enclave and remapped topics."""
    kept = []
    for word, value in itertools.pairwise(words):
        node = value.split(":=")[0].split(":")[-1] in ("__node", "__name")
        if word in ("--enclave", "-e") or (word in ("--remap", "-r") and not node):
            kept += [word, value]
    return ["--ros-args", *kept] if kept else []


class OutputLink(Link):
    """A link through an output process, with a standby process that takes over by a vent.

    Args:
        name: Name in diagnostics and in the bag.
        kind: Kind of the device: 'modbus', 'serial' or 'topics'.
        settings: Settings of the device.
        limits: Limits that hold.
        clock: Steady clock [s].
        commands: Whether it may write.
        program: Module that the process runs.
        has_clock: Whether the rig answers with stamps.
    """

    def __init__(
        self,
        name: str,
        kind: str,
        settings: ModbusMap | SerialSettings | TopicSettings,
        limits: Limits,
        clock: Callable[[], float],
        *,
        commands: bool,
        program: str = WIRE_PROGRAM,
        has_clock: bool = False,
    ) -> None:
        super().__init__(name, clock)
        self.commands = commands
        self.clock_estimate = ClockEstimate() if has_clock else None
        self._limits, self._program = limits, program
        self._description = {
            "link": kind,
            "settings": dataclasses.asdict(settings),
            "limits": dataclasses.asdict(limits),
            "commands": commands,
        }
        self._lock = threading.Lock()
        self._active: _Process | None = None
        self._standby: _Process | None = None
        self._epoch = 0
        self._ending: dict[str, Any] | None = None
        self._end_by = 0.0
        self._endings = 0
        self._ended = False
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, *, vent: str = "") -> None:
        """Start the processes; with a reason to vent, the first act is a vent."""
        with self._lock:
            self._active = _Process(self._program, self._description)
            self._active.begin(self._beginning(vent))
            if self.commands:
                self._standby = _Process(self._program, self._description)
        self._thread = threading.Thread(target=self._watch, name=f"link {self.name}", daemon=True)
        self._thread.start()

    def wait_until_ready(self) -> None:
        """Wait until the output process has exchanged once with its device, or could not; bounded."""
        end = time.monotonic() + _LONGEST_START
        while not self.status.ready and time.monotonic() < end:
            time.sleep(0.01)

    def send(self, pressure: Pressures, epoch: int) -> None:
        """Hand set-points of an armed gate to the output process: gauge [Pa], one for each arm, and their epoch."""
        self._epoch = max(self._epoch, epoch)
        self._tell({"target": list(pressure), "epoch": epoch, "time": self.clock()})

    def vent(self, reason: str, epoch: int) -> None:
        """Let the output process ramp to zero and stay there."""
        self._epoch = max(self._epoch, epoch)
        self._tell({"vent": reason, "epoch": self._epoch})

    def check(self) -> None:
        """Report a dead watch thread as a broken connection."""
        if self._thread is not None and not self._thread.is_alive():
            self.connected, self.error = False, "the thread that watches the output process has ended"

    def stop(self) -> str:
        """Vent where it may write, end the processes; return which arms may hold pressure, '' for none."""
        if self._thread is None:
            return ""
        patience = self._limits.command_timeout + self._limits.vent_time
        with self._lock:
            self._ending = {"end": "the bridge ends", "patience": patience}
            self._end_by = time.monotonic() + patience + _ENDING
            if self._active is not None:
                self._active.channel.send(self._ending)
        while time.monotonic() < self._end_by and not self._ended and self._thread.is_alive():
            self._tell(self._ending)  # again, because a full channel drops a message
            time.sleep(0.02)
        self._stopping.set()
        self._thread.join(2.0)
        with self._lock:
            return self._finish()

    def _finish(self) -> str:
        active, self._active = self._active, None
        standby, self._standby = self._standby, None
        if standby is not None:
            standby.dismiss()
        if active is None:
            return f"{self.name}: the output process is lost" if self.commands else ""
        code = active.process.poll()
        if code is None:
            active.kill()
        else:
            active.channel.close()
        if code == 0 or not self.commands:
            return ""
        holding = self.status.holding or "the arms may hold pressure"
        return f"{self.name}: no zero was confirmed ({self.status.error or 'no answer to it'}); {holding}"

    def _beginning(self, vent: str) -> dict[str, Any]:
        return {"begin": "vent" if vent else "idle", "reason": vent, "epoch": self._epoch}

    def _tell(self, message: dict[str, Any]) -> None:
        with self._lock:
            if self._active is not None:
                self._active.channel.send(message)

    def _watch(self) -> None:
        """Take what the process sends; replace it when it ends or says nothing."""
        while not self._stopping.is_set() and not self._ended:
            active = self._active
            if active is None:
                return
            try:
                why = self._hear(active)
            except Exception as error:  # a process that sends nonsense is as good as lost
                why = f"the output process sends nonsense: {error!r}"
            if not why:
                continue
            try:
                self._replace(active, why)
            except (OSError, subprocess.SubprocessError) as error:
                # No process can be started now: the next pass tries again.
                self.connected, self.error = False, f"{why}; no other one starts: {error}"
                time.sleep(_LOOK)

    def _hear(self, active: _Process) -> str:
        """Take what the process sent; return why it is lost, '' while it is not."""
        # Silence is counted in waits: time in which the bridge itself was stopped does not count.
        if not select.select([active.channel], [], [], _LOOK)[0]:
            active.silence += _LOOK
            if active.silence <= active.patience:
                return ""
            return f"the output process was silent for {active.silence:.1f} s"
        active.silence = 0.0
        for message in active.channel.receive():
            active.patience = _LONGEST_SILENCE
            self._take(Exchange.from_dict(message))
        if not active.channel.lost:
            return ""
        status = active.process.wait(1.0)
        if self._ending is not None and status in (0, UNCONFIRMED):
            self._ended = True
            return ""
        return f"the output process ended (status {status})"

    def _replace(self, active: _Process, why: str) -> None:
        active.kill()
        with self._lock:
            self.replaced += 1
            self.connected, self.error = False, why
            if self._ending is not None:
                self._endings += 1
                if self._endings > _MOST_ENDINGS or not self.commands:
                    self._ended = True
                    return
                self._end_by += _LONGEST_SILENCE + self._limits.command_timeout + self._limits.vent_time
            replacement = self._standby if self.commands else None
            if replacement is None or replacement.process.poll() is not None:
                replacement = _Process(self._program, self._description)
            replacement.begin(self._beginning(why if self.commands else ""))
            self._active = replacement
            if self._ending is not None:
                replacement.channel.send(self._ending)
                self._standby = None
            elif self.commands:
                self._standby = _Process(self._program, self._description)

    def _take(self, exchange: Exchange) -> None:
        self.take_status(exchange.status)
        for sent, stamp, received in exchange.round_trips:
            if self.clock_estimate is not None:
                self.clock_estimate.round_trip(sent, stamp, received)
        # A rig on topics is heard by the bridge itself, with stamps; copies without them would hide old readings.
        for raw in exchange.readings if self._program == WIRE_PROGRAM else ():
            self._readings.append(
                RawReading(raw.kind, raw.arm, np.array(raw.value), raw.heard, self.name, raw.stamp)
            )
        for packet in exchange.packets:
            self._packets.append(RawPacket(self.name, packet.sent, packet.data, packet.time))

    def take_status(self, status: OutputStatus) -> None:
        """Take the status of the output stage."""
        self.status = status
        self.connected, self.error = status.connected, status.error
        self.drops, self.malformed, self.heartbeats = status.drops, status.malformed, status.heartbeats

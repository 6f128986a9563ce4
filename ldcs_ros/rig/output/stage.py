"""`OutputStage`: device, limiter and monitor in one step that a process repeats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.device import Device, DevicePacket, DeviceReading
from ldcs_ros.rig.output.limiter import OutputLimiter, OutputState
from ldcs_ros.rig.output.monitor import WriteMonitor

RETRY_PERIOD = 0.2
ORPHAN_PATIENCE = 60.0
"""Time for which a stage without its bridge tries to vent [s]."""


@dataclass(frozen=True)
class OutputStatus:
    """A report of an output stage.

    Attributes:
        ready: Whether the process has begun to exchange.
        state: An OutputState's value.
        reason: Cause of the vent; '' for none.
        epoch: Arming whose set-points are followed, or were followed last.
        sent: Set-points sent last, gauge [Pa].
        connected: Whether the last exchange worked.
        error: Cause of a broken connection; '' while connected.
        drops: Number of lost connections.
        malformed: Number of packets that made no sense.
        heartbeats: Number of writes.
        refusals: Number of refused writes.
        clipped: Number of set-points that the gate let pass and the limiter did not.
        zero_confirmed: Whether the rig confirmed a set-point of zero.
        holding: Arms that hold pressure or work to a set-point, in words; '' for none.
    """

    ready: bool = False
    state: str = OutputState.IDLE.value
    reason: str = ""
    epoch: int = 0
    sent: tuple[float, ...] = ()
    connected: bool = False
    error: str = "not opened yet"
    drops: int = 0
    malformed: int = 0
    heartbeats: int = 0
    refusals: int = 0
    clipped: int = 0
    zero_confirmed: bool = False
    holding: str = ""


@dataclass(frozen=True)
class Exchange:
    """The result of one step: readings, packets, round trips (sent, stamp, received) [s] and the stage's status."""

    readings: list[DeviceReading]
    packets: list[DevicePacket]
    round_trips: list[tuple[float, float, float]]
    status: OutputStatus

    def as_dict(self) -> dict[str, object]:
        """Return the content as plain values for JSON; bytes as hexadecimal digits."""
        return {
            "readings": [[r.kind, r.arm, r.value, r.heard, r.stamp] for r in self.readings],
            "packets": [[p.sent, p.data.hex(), p.time] for p in self.packets],
            "round_trips": self.round_trips,
            "status": asdict(self.status),
        }

    @classmethod
    def from_dict(cls, content: dict) -> Exchange:  # type: ignore[type-arg]
        """Return the exchange of plain values."""
        status = dict(content["status"])
        status["sent"] = tuple(status["sent"])
        return cls(
            [DeviceReading(*one) for one in content["readings"]],
            [DevicePacket(sent, bytes.fromhex(data), time) for sent, data, time in content["packets"]],
            [(sent, stamp, received) for sent, stamp, received in content["round_trips"]],
            OutputStatus(**status),
        )


class OutputStage:
    """The last stage before a rig: exchanges with the device, bounds, monitors, and vents by itself.

    Args:
        device: The device, not yet open.
        limits: Limits that hold.
        clock: Steady clock [s].
        commands: Whether it may write at all.

    Attributes:
        limiter: The bound on what is sent.
        monitor: The judge of what the rig reports.
        ended: Whether its work is done; nothing more is exchanged.
        confirmed: Whether it ended with a confirmed zero, or never was to write.
    """

    def __init__(
        self,
        device: Device,
        limits: Limits,
        clock: Callable[[], float],
        *,
        commands: bool,
    ) -> None:
        self.device, self.commands = device, commands
        self._clock = clock
        self.limiter = OutputLimiter(limits, clock)
        self.monitor = WriteMonitor(
            limits,
            clock,
            resolution=device.resolution,
            reads_back=device.reads_back,
            acknowledges=device.acknowledges,
        )
        self._arms = limits.arms
        self._is_open = False
        self._connected = False
        self._error = "not opened yet"
        self._drops = 0
        self._deadline: float | None = None
        self._taken = device.take()  # readings from before the device was in use are obsolete
        self.ended = False
        self.confirmed = not commands

    def set_target(self, pressure: list[float], epoch: int, time: float) -> None:
        """Take set-points of the gate [Pa], the epoch of their arming, and their steady time [s]."""
        if self._deadline is None:
            self.limiter.set_target(tuple(pressure), epoch, time)

    def vent(self, reason: str, epoch: int | None = None) -> None:
        """Ramp to zero and stay there; from idle, the ramp begins at the set-points that the rig reports."""
        start = [self.monitor.read_back.get(arm, 0.0) for arm in self._arms]
        self.limiter.vent(reason, start=start, epoch=epoch)

    def end(self, reason: str, patience: float) -> None:
        """Vent, and end with a confirmed zero, or after a time without one [s]."""
        if self.commands:
            self.vent(reason)
        if self._deadline is None:
            self._deadline = self._clock() + patience

    def step(self) -> float:
        """Exchange once with the device; return the time until the next exchange [s]."""
        setpoint = self.limiter.next() if self.commands else None
        wait = 1.0 / self.device.rate
        try:
            if not self._is_open:
                self.device.open()
                self._is_open = True
            self.device.exchange(setpoint)
            self._connected, self._error = True, ""
            self.monitor.note_sent(setpoint)
        except Exception as error:  # foreign bytes fail in as many ways as there are bytes
            self._disconnect(str(error) or repr(error))
            wait = RETRY_PERIOD
        self._taken = self.device.take()
        self._judge()
        if self._deadline is not None:
            self._finish()
        return wait

    def exchange(self) -> Exchange:
        """Return the result of the last step."""
        readings, packets, round_trips, _ = self._taken
        limiter, monitor, device = self.limiter, self.monitor, self.device
        status = OutputStatus(
            ready=True,
            state=limiter.state.value,
            reason=limiter.reason,
            epoch=limiter.epoch,
            sent=limiter.sent,
            connected=self._connected,
            error=self._error,
            drops=self._drops,
            malformed=device.malformed,
            heartbeats=device.heartbeats,
            refusals=monitor.refusals,
            clipped=limiter.clipped_count,
            zero_confirmed=monitor.zero_is_confirmed(),
            holding=monitor.holding(),
        )
        return Exchange(readings, packets, round_trips, status)

    def close(self) -> None:
        """Disconnect."""
        self._is_open = False
        self.device.close()

    def _disconnect(self, error: str) -> None:
        self._drops += self._connected
        self._connected, self._error = False, error.splitlines()[0]
        self._is_open = False
        try:
            self.device.close()
        except Exception as closing:  # a device that cannot be closed is closed
            self._error += f" ({closing})"

    def _judge(self) -> None:
        readings, _, _, answers = self._taken
        for answer in answers:
            if answer:
                self.monitor.note_refused(answer)
            else:
                self.monitor.note_acknowledged()
        for reading in readings:
            if reading.kind == "pressure_command":
                self.monitor.note_read_back(reading.arm, reading.value, reading.heard)
            else:
                self.monitor.note_measured(reading.arm, reading.value, reading.heard)
        if self.limiter.state is OutputState.ACTIVE:
            fault = self.monitor.fault()
            if fault:
                self.limiter.vent(fault)
            elif not self._connected:
                self.limiter.vent(f"the connection is lost: {self._error}")

    def _finish(self) -> None:
        self.confirmed = not self.commands or (self._connected and self.monitor.zero_is_confirmed())
        if self.confirmed or self._clock() > (self._deadline or 0.0):
            self.ended = True
            self.close()

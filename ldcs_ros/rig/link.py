"""`Link`: one way to a rig, as the bridge sees it: readings, raw packets, set-points, status."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.limits import Pressures
from ldcs_ros.rig.output.limiter import OutputState
from ldcs_ros.rig.output.stage import OutputStatus
from ldcs_ros.rig.reading import RawReading

_MOST_WAITING = 10_000


@dataclass(frozen=True)
class RawPacket:
    """Bytes as they went over a link.

    Attributes:
        link: Name of the link, or topic of a message.
        sent: Whether the bridge sent them.
        data: The bytes.
        time: Steady time [s].
        type: ROS type of a message; '' for other bytes.
    """

    link: str
    sent: bool
    data: bytes
    time: float
    type: str = ""


class Link:
    """A way to a rig. This base only listens; a link that commands overrides `send`, `vent` and `stop`.

    Args:
        name: Name in diagnostics and in the bag.
        clock: Steady clock [s].

    Attributes:
        commands: Whether set-points go this way.
        connected: Whether the last exchange worked.
        error: Cause in words; '' while connected.
        drops: Number of lost connections.
        malformed: Number of packets that made no sense.
        heartbeats: Number of writes.
        replaced: Number of output processes that were lost and replaced.
        status: Latest status of the output stage.
        clock_estimate: Offset and round trip, for a rig that answers with a stamp.
    """

    commands = False

    def __init__(self, name: str, clock: Callable[[], float]) -> None:
        self.name, self.clock = name, clock
        self.connected, self.error = False, "not opened yet"
        self.drops = self.malformed = self.heartbeats = self.replaced = 0
        self.status = OutputStatus()
        self.clock_estimate: ClockEstimate | None = None
        self._readings: deque[RawReading] = deque(maxlen=_MOST_WAITING)
        self._packets: deque[RawPacket] = deque(maxlen=_MOST_WAITING)

    @property
    def vented_because(self) -> str:
        """Cause of a vent of the output stage, in words; '' while it has not vented."""
        return self.status.reason if self.status.state == OutputState.VENTED.value else ""

    def start(self, *, vent: str = "") -> None:
        """Begin; with a reason to vent, the first act is a vent."""
        self.connected, self.error = True, ""

    def wait_until_ready(self) -> None:
        """Wait until set-points can go this way."""

    def check(self) -> None:
        """Notice that what serves this link has ended."""

    def send(self, pressure: Pressures, epoch: int) -> None:
        """Hand on set-points of an armed gate: gauge [Pa], one for each arm, and the epoch of their arming."""

    def vent(self, reason: str, epoch: int) -> None:
        """Ramp to zero and stay there until a later epoch."""

    def stop(self) -> str:
        """End; return which arms may hold pressure, in words; '' for none."""
        return ""

    def take_readings(self) -> list[RawReading]:
        """Return what has come since the last call, oldest first."""
        return [self._readings.popleft() for _ in range(len(self._readings))]

    def take_packets(self) -> list[RawPacket]:
        """Return the raw packets since the last call, oldest first."""
        return [self._packets.popleft() for _ in range(len(self._packets))]

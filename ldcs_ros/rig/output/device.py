"""`Device`: the contract of a transport that takes set-points, and what it hands on."""

from __future__ import annotations

import abc
from collections.abc import Callable
from dataclasses import dataclass

from ldcs_ros.rig.limits import Pressures

_MOST_WAITING = 2_000


def missing_package(what: str, package: str) -> str:
    """Return the error of a transport whose package is not installed."""
    # Loaded here alone: the output process starts with as little as it can.
    from ldcs_ros import extras

    return (
        f"{what} needs the package {package}, which is not installed; run `{extras.advice('rig', package)}`"
    )


@dataclass(frozen=True)
class DeviceReading:
    """A pressure as the device reported it.

    Attributes:
        kind: 'pressure' (measured) or 'pressure_command' (the set-point the rig works to).
        arm: Name of the arm.
        value: Gauge pressure [Pa].
        heard: Steady time at which it was heard [s].
        stamp: Time on the rig's clock [s]; None if the rig gives none.
    """

    kind: str
    arm: str
    value: float
    heard: float
    stamp: float | None


@dataclass(frozen=True)
class DevicePacket:
    """Bytes that went over the wire: whether the bridge sent them, the bytes, and the steady time [s]."""

    sent: bool
    data: bytes
    time: float


class Device(abc.ABC):
    """A rig's controller on one transport.

    The contract:

    1. `open` and `exchange` raise on any trouble; whatever they raise is a lost connection.
    2. `close` never raises.
    3. `exchange` with None writes nothing.
    4. Readings, packets, acknowledgements and refusals collect until `take`.

    Args:
        name: Name in diagnostics and in the bag.
        clock: Steady clock [s].
        rate: Exchanges per second [Hz].

    Attributes:
        reads_back: Whether it reports the set-points the rig works to.
        acknowledges: Whether each write is confirmed or refused.
        resolution: Smallest step of a set-point [Pa].
        malformed: Number of packets that made no sense.
        heartbeats: Number of writes so far.
    """

    reads_back = True
    acknowledges = True

    def __init__(self, name: str, clock: Callable[[], float], rate: float, resolution: float) -> None:
        self.name, self.clock, self.rate, self.resolution = name, clock, rate, resolution
        self.malformed = 0
        self.heartbeats = 0
        self._readings: list[DeviceReading] = []
        self._packets: list[DevicePacket] = []
        self._round_trips: list[tuple[float, float, float]] = []
        self._answers: list[str] = []

    @abc.abstractmethod
    def open(self) -> None:
        """Connect."""

    @abc.abstractmethod
    def close(self) -> None:
        """Disconnect."""

    @abc.abstractmethod
    def exchange(self, setpoint: Pressures | None) -> None:
        """Send set-points, gauge [Pa], unless None, and receive what there is."""

    def take(
        self,
    ) -> tuple[list[DeviceReading], list[DevicePacket], list[tuple[float, float, float]], list[str]]:
        """Return readings, packets, round trips (sent, stamp, received) [s] and answers ('' or a refusal)."""
        taken = self._readings, self._packets, self._round_trips, self._answers
        self._readings, self._packets, self._round_trips, self._answers = [], [], [], []
        return taken

    def report(self, kind: str, arm: str, value: float, *, stamp: float | None = None) -> None:
        """Hand on a pressure [Pa] that came just now."""
        if len(self._readings) < _MOST_WAITING:
            self._readings.append(DeviceReading(kind, arm, value, self.clock(), stamp))

    def record(self, data: bytes, *, sent: bool) -> None:
        """Keep raw bytes for the bag."""
        if len(self._packets) < _MOST_WAITING:
            self._packets.append(DevicePacket(sent, bytes(data), self.clock()))

    def acknowledge(self) -> None:
        """Hand on that the rig confirmed a write."""
        self._answers.append("")

    def refuse(self, reason: str) -> None:
        """Hand on that the rig refused a write."""
        self._answers.append(reason or "no reason given")

    def round_trip(self, sent: float, stamp: float, received: float) -> None:
        """Hand on the stamp [s] of an answer and when it was asked and heard [s]."""
        self._round_trips.append((sent, stamp, received))

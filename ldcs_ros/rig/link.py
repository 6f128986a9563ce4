"""`Link`: one connection to a rig with its own thread, raw frames, health, and the last stage of every limit."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import LinkError
from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.limits import LastStage, Limits
from ldcs_ros.rig.reading import Reading

_MOST_WAITING = 10_000
_RETRY_PERIOD = 0.2


@dataclass(frozen=True)
class Frame:
    """Bytes as they went over a link.

    Attributes:
        link: Name of the link, or topic of a message.
        sent: Whether the bridge sent them.
        data: The bytes.
        time: When [s of the bridge's clock].
        type: ROS type of a message; '' for other bytes.
    """

    link: str
    sent: bool
    data: bytes
    time: float
    type: str = ""


class Link:
    """Base of the transports; a subclass opens, closes and exchanges, everything else is here.

    Args:
        name: What diagnostics and the bag call it.
        limits: Hard limits, kept here once more.
        clock: Steady clock [s].
        rate: Exchanges a second [Hz].

    Attributes:
        connected: Whether the last exchange worked.
        error: Why it does not, in words; '' while it does.
        drops: How often the connection was lost.
        malformed: Frames that made no sense.
        clock_estimate: Offset and round trip, where the rig answers with a stamp.
    """

    commands = True

    def __init__(self, name: str, limits: Limits, clock: Callable[[], float], rate: float) -> None:
        self.name, self.rate = name, rate
        self.clock = clock
        self.stage = LastStage(limits, clock)
        self.connected = False
        self._is_open = False
        self.error = "not opened yet"
        self.drops = 0
        self.malformed = 0
        self.beats = 0
        self.clock_estimate: ClockEstimate | None = None
        self._readings: deque[Reading] = deque(maxlen=_MOST_WAITING)
        self._frames: deque[Frame] = deque(maxlen=_MOST_WAITING)
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    # -- what a transport is

    def open(self) -> None:
        """Connect; raises LinkError."""
        raise NotImplementedError

    def close(self) -> None:
        """Disconnect; never raises."""
        raise NotImplementedError

    def exchange(self, setpoint: np.ndarray | None) -> None:
        """Send set-points [Pa], shape (n_arms,), unless None, and receive what there is; raises LinkError."""
        raise NotImplementedError

    # -- what they all do

    def start(self) -> None:
        """Start exchanging on a thread of its own."""
        self._thread = threading.Thread(target=self._run, name=f"link {self.name}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and the connection."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(5.0)
        else:
            self.close()

    def offer(self, setpoint: np.ndarray | None) -> None:
        """Take the gate's set-points [Pa], shape (n_arms,); None to send nothing."""
        self.stage.offer(setpoint)

    def take_readings(self) -> list[Reading]:
        """Return what has come since the last call, oldest first."""
        return [self._readings.popleft() for _ in range(len(self._readings))]

    def take_frames(self) -> list[Frame]:
        """Return the raw frames since the last call, oldest first."""
        return [self._frames.popleft() for _ in range(len(self._frames))]

    def work(self) -> float:
        """Connect or exchange once; return how long to wait before the next time [s]."""
        try:
            if not self._is_open:
                self.open()
                self._is_open = True
            self.exchange(self.stage.next())
        except LinkError as error:
            self.drops += self.connected
            self.connected, self.error = False, str(error)
            self._is_open = False
            self.close()
            return _RETRY_PERIOD
        # A rig that takes a connection and then says nothing is not connected.
        self.connected, self.error = True, ""
        return 1.0 / self.rate

    def record(self, data: bytes, *, sent: bool) -> None:
        """Keep a raw frame for the bag."""
        self._frames.append(Frame(self.name, sent, bytes(data), self.clock()))

    def report(
        self, kind: str, name: str, value: np.ndarray, *, stamp: float | None = None, age: float = 0.0
    ) -> None:
        """Hand on a reading that came just now."""
        self._readings.append(Reading(kind, name, value, self.clock(), self.name, stamp, age))

    def _run(self) -> None:
        next_time = self.clock()
        while not self._stopping.is_set():
            next_time = max(next_time + self.work(), self.clock() - 0.1)
            self._stopping.wait(max(0.0, next_time - self.clock()))
        self.close()

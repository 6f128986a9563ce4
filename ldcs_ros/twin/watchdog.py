"""The watchdog of the commands: it detects a silent sender on a steady clock; and the ramp that vents the arms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RAMP_TIME = 0.5
"""Duration of the ramp [s] of simulation time."""


@dataclass(frozen=True)
class VentRamp:
    """A straight ramp to zero.

    Attributes:
        start: Time of its begin [s].
        value: Command at the start, gauge pressures [Pa] or torques [N m], any shape.
        duration: Its duration [s].
    """

    start: float
    value: np.ndarray
    duration: float = RAMP_TIME

    def at(self, time: float) -> np.ndarray:
        """Return the command at `time` [s], the shape of `value`."""
        fraction = (time - self.start) / self.duration if self.duration > 0.0 else 1.0
        return self.value * max(0.0, 1.0 - fraction)

    def is_over(self, time: float) -> bool:
        """Return whether zero has been reached at `time` [s]."""
        return time - self.start >= self.duration


class Watchdog:
    """Watches the arms' commands, and each wrench on its own.

    The first command arms it: a twin without commands follows its scene. Once tripped it
    stays tripped until `rearm`. Time spent suspended (the twin is paused) does not count.

    Args:
        clock: Steady clock [s].
        timeout: Longest silence of the arms' commands [s]; 0 for no watch.
        wrench_timeout: Longest time that a wrench is held [s]; 0 for ever.

    Attributes:
        tripped: The arms' commands went stale and no `rearm` followed.
        trips: Number of trips.
    """

    def __init__(
        self, clock: Callable[[], float], *, timeout: float = 0.0, wrench_timeout: float = 0.0
    ) -> None:
        self._clock = clock
        self.timeout = timeout
        self.wrench_timeout = wrench_timeout
        self.tripped = False
        self.trips = 0
        self._fed_at: float | None = None
        self._wrench_at: dict[str, float] = {}
        self._suspended_at: float | None = None

    @property
    def state(self) -> str:
        """'off', 'idle' (no command yet), 'armed' or 'tripped'."""
        if self.tripped:
            return "tripped"
        if self.timeout <= 0.0:
            return "off"
        return "idle" if self._fed_at is None else "armed"

    def feed(self) -> None:
        """Note an applied command for the arms."""
        self._fed_at = self._now()

    def feed_wrench(self, frame: str) -> None:
        """Note an applied wrench at a frame."""
        self._wrench_at[frame] = self._now()

    def release_wrench(self, frame: str) -> None:
        """Forget the wrench at a frame: no sender holds it any more."""
        self._wrench_at.pop(frame, None)

    def check(self) -> bool:
        """Return True once when the arms' commands have gone stale; the caller then vents."""
        if self.tripped or self.timeout <= 0.0 or self._fed_at is None:
            return False
        if self._now() - self._fed_at <= self.timeout:
            return False
        self.tripped = True
        self.trips += 1
        return True

    def stale_wrenches(self) -> list[str]:
        """Return the frames whose wrenches were held long enough, each once; the caller then clears them."""
        if self.wrench_timeout <= 0.0:
            return []
        now = self._now()
        stale = [frame for frame, since in self._wrench_at.items() if now - since > self.wrench_timeout]
        for frame in stale:
            del self._wrench_at[frame]
        return stale

    def rearm(self) -> bool:
        """Accept commands again and wait for the first one; return whether it had tripped."""
        tripped, self.tripped = self.tripped, False
        self._fed_at = None
        return tripped

    def reset(self) -> None:
        """Back to the start, as after a reset of the twin."""
        self.rearm()
        self._wrench_at.clear()

    def suspend(self) -> None:
        """Stop counting silence."""
        if self._suspended_at is None:
            self._suspended_at = self._clock()

    def resume(self) -> None:
        """Go on counting where `suspend` stopped."""
        if self._suspended_at is None:
            return
        pause = self._clock() - self._suspended_at
        self._suspended_at = None
        self._fed_at = None if self._fed_at is None else self._fed_at + pause
        self._wrench_at = {frame: since + pause for frame, since in self._wrench_at.items()}

    def _now(self) -> float:
        return self._clock() if self._suspended_at is None else self._suspended_at

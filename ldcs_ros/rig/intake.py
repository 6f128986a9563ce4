"""Intake: what a rig reports is checked, freed of duplicates, and put on the bridge's clock."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from ldcs_ros.rig.clocks import JUMP, ClockEstimate
from ldcs_ros.rig.reading import Reading

_FARTHEST = 2.0  # m: no probe of a sheet of centimetres is farther from its base
_DEEPEST = -50e3  # Pa gauge: half a vacuum


@dataclass(frozen=True)
class Sample:
    """A reading that was found sound.

    Attributes:
        kind: As `Reading.kind`.
        name: Arm or point.
        value: Gauge pressure [Pa], shape (), or position in ldcs_base [m], shape (3,).
        time: When it was measured [s of the bridge's clock].
        received: When it came [s of the bridge's clock].
    """

    kind: str
    name: str
    value: np.ndarray
    time: float
    received: float


class Intake:
    """Sorts sound readings from others and counts why the others were dropped.

    Args:
        highest_pressure: Largest pressure that a sensor can sensibly report [Pa].
        start: Steady time from which silence counts [s].

    Attributes:
        accepted: Number of sound readings.
        dropped: Number of dropped readings by reason.
        last_drop: The latest drop in words; '' while there was none.
        clocks: Clock of each source that stamps.
        heard_at: When the latest sound reading was measured, by 'kind name' [s of the bridge's clock].
        came_at: When the last sound reading came, whatever its age [s of the bridge's clock].
    """

    def __init__(self, highest_pressure: float, start: float) -> None:
        self._highest = highest_pressure
        self._start = start
        self.accepted = 0
        self.dropped: Counter[str] = Counter()
        self.last_drop = ""
        self.clocks: dict[str, ClockEstimate] = {}
        self.heard_at: dict[str, float] = {}
        self.came_at = start
        self._last: dict[tuple[str, str, str], float] = {}
        self._jumps: Counter[str] = Counter()

    def restart(self, start: float) -> None:
        """Let silence count from a steady time [s]."""
        self._start = self.came_at = start

    def take(self, reading: Reading) -> Sample | None:
        """Return the sound sample of a reading, or None if it was dropped and counted."""
        channel = f"{reading.kind} {reading.name}"
        complaint = self._unsound(reading)
        if complaint:
            self._drop(*complaint, channel)
            return None
        time = reading.received
        if reading.stamp is not None:
            clock = self.clocks.setdefault(reading.source, ClockEstimate())
            key = (reading.source, reading.kind, reading.name)
            complaint = self._stale(key, reading.stamp, clock)
            if complaint:
                self._drop(*complaint, channel)
                return None
            if not clock.one_way(reading.stamp, reading.received):
                self._drop("out of order", f"stamp {reading.stamp:.6f} s is far behind", channel)
                return None
            if clock.jumps > self._jumps[reading.source]:
                self._jumps[reading.source] = clock.jumps
                self._last.clear()
            self._last[key] = reading.stamp
            time = min(clock.local(reading.stamp), reading.received)
        self.accepted += 1
        self.heard_at[channel] = time
        self.came_at = reading.received
        return Sample(reading.kind, reading.name, reading.value, time - reading.age, reading.received)

    def silence(self, now: float, kind: str) -> float:
        """Return how old the latest sound reading of a kind is, of the quietest arm or point that ever spoke [s].

        Before the first one, silence counts from the start.
        """
        heard = [time for channel, time in self.heard_at.items() if channel.split()[0] == kind]
        return now - min(heard, default=self._start)

    def staleness(self, now: float, kind: str, timeout: float) -> str:
        """Return what is too old about a kind of readings, in words; '' while all are fresh."""
        silence = self.silence(now, kind)
        if silence <= timeout:
            return ""
        if now - self.came_at > 0.5 * timeout:
            return f"the rig is silent for {silence:.2f} s"
        old = [
            channel.split()[1]
            for channel, time in self.heard_at.items()
            if channel.split()[0] == kind and now - time > timeout
        ]
        return f"{kind} of {', '.join(old) or 'the rig'} is {silence:.2f} s old"

    def _unsound(self, reading: Reading) -> tuple[str, str] | None:
        value = np.asarray(reading.value, dtype=float)
        shown = np.array2string(value, precision=6)
        if reading.stamp is not None and not math.isfinite(reading.stamp):
            return "not a number", f"stamp {reading.stamp}"
        if not np.isfinite(value).all():
            return "not a number", f"got {shown}"
        if reading.kind == "position":
            if value.shape != (3,) or np.abs(value).max() > _FARTHEST:
                return "implausible", f"got {shown} m, expected within {_FARTHEST:g} m"
        elif not _DEEPEST <= float(value) <= self._highest:
            return "implausible", f"got {shown} Pa, expected {_DEEPEST:g} ... {self._highest:g} Pa"
        return None

    def _stale(self, key: tuple[str, str, str], stamp: float, clock: ClockEstimate) -> tuple[str, str] | None:
        before = self._last.get(key)
        if before is None or stamp > before:
            return None
        if stamp == before:
            return "duplicate", f"stamp {stamp:.6f} s came before"
        if stamp > before - JUMP:
            return "out of order", f"stamp {stamp:.6f} s came after {before:.6f} s"
        return None  # the clock itself went back; its estimate decides

    def _drop(self, reason: str, detail: str, channel: str) -> None:
        self.dropped[reason] += 1
        self.last_drop = f"{channel}: {reason}, {detail}"

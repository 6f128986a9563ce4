"""Checks of the readings of a rig: range, order, duplicates; and their time on the bridge's clock."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from ldcs_ros.rig.clocks import JUMP, ClockEstimate
from ldcs_ros.rig.reading import RawReading

_FARTHEST = 2.0  # m: no probe of a sheet of centimetres is farther from its base
_DEEPEST = -50e3  # Pa gauge: half a vacuum


@dataclass(frozen=True)
class Reading:
    """A valid reading.

    Attributes:
        kind: As `RawReading.kind`.
        name: Arm or point.
        value: Gauge pressure [Pa], shape (), or position in ldcs_base [m], shape (3,).
        time: Time of the measurement [s of the bridge's clock].
        received: Time of its arrival [s of the bridge's clock].
    """

    kind: str
    name: str
    value: np.ndarray
    time: float
    received: float


class ReadingValidator:
    """A filter of valid readings, with counts of the dropped ones by reason.

    Args:
        highest_pressure: Largest pressure that a sensor can sensibly report [Pa].
        start: Steady time from which silence counts [s].

    Attributes:
        accepted: Number of valid readings.
        dropped: Number of dropped readings by reason.
        last_drop: The latest drop in words; '' while there was none.
        clocks: Clock of each source that stamps.
        heard_at: Time of the latest valid measurement by 'kind name' [s of the bridge's clock].
        came_at: Arrival of the latest valid reading, whatever its age [s of the bridge's clock].
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

    def validate(self, raw: RawReading) -> Reading | None:
        """Return a valid reading, or None for one that is dropped and counted."""
        channel = f"{raw.kind} {raw.name}"
        validation_error = self._range_error(raw)
        if validation_error:
            self._drop(*validation_error, channel)
            return None
        time = raw.received
        if raw.stamp is not None:
            clock = self.clocks.setdefault(raw.source, ClockEstimate())
            key = (raw.source, raw.kind, raw.name)
            validation_error = self._order_error(key, raw.stamp, clock)
            if validation_error:
                self._drop(*validation_error, channel)
                return None
            if not clock.one_way(raw.stamp, raw.received):
                self._drop("out of order", f"stamp {raw.stamp:.6f} s is far too early", channel)
                return None
            if clock.jumps > self._jumps[raw.source]:
                self._jumps[raw.source] = clock.jumps
                self._last.clear()
            self._last[key] = raw.stamp
            time = min(clock.local(raw.stamp), raw.received)
        self.accepted += 1
        self.heard_at[channel] = time
        self.came_at = raw.received
        return Reading(raw.kind, raw.name, raw.value, time - raw.age, raw.received)

    def silence(self, now: float, kind: str) -> float:
        """Return the age of the latest valid reading of a kind, for the quietest arm or point heard so far [s].

        Before the first one, silence counts from the start.
        """
        heard = [time for channel, time in self.heard_at.items() if channel.split()[0] == kind]
        return now - min(heard, default=self._start)

    def staleness(self, now: float, kind: str, timeout: float) -> str:
        """Return the readings of a kind that are too old, in words; '' while all are fresh."""
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

    def _range_error(self, raw: RawReading) -> tuple[str, str] | None:
        value = np.asarray(raw.value, dtype=float)
        shown = np.array2string(value, precision=6)
        if raw.stamp is not None and not math.isfinite(raw.stamp):
            return "not a number", f"stamp {raw.stamp}"
        if not np.isfinite(value).all():
            return "not a number", f"got {shown}"
        if raw.kind == "position":
            if value.shape != (3,) or np.abs(value).max() > _FARTHEST:
                return "implausible", f"got {shown} m, expected within {_FARTHEST:g} m"
        elif not _DEEPEST <= float(value) <= self._highest:
            return "implausible", f"got {shown} Pa, expected {_DEEPEST:g} ... {self._highest:g} Pa"
        return None

    def _order_error(
        self, key: tuple[str, str, str], stamp: float, clock: ClockEstimate
    ) -> tuple[str, str] | None:
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

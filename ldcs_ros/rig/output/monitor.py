"""Compares what a rig reports with what was sent to it: read-back, acknowledgement, limit, empty chambers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from ldcs_ros.rig.limits import Limits, Pressures

MEASURED_TOLERANCE = 0.08
"""Fraction of the largest pressure by which a sound pressure sensor may read above it."""
EMPTY = 0.05
"""Fraction of the largest pressure below which a chamber counts as empty."""
_PERSISTENCE = 0.1  # s: one wrong reading is no fault yet


class WriteMonitor:
    """A judge of whether writes reach the rig and what they do there.

    Args:
        limits: Limits that hold.
        clock: Steady clock [s].
        resolution: Smallest step of a set-point that the device can represent [Pa].
        reads_back: Whether the device reports the set-points it works to.
        acknowledges: Whether the device confirms or refuses each write.

    Attributes:
        refusals: Number of refused writes.
        read_back: Latest reported set-point by arm [Pa].
        measured: Latest measured pressure by arm [Pa].
    """

    def __init__(
        self,
        limits: Limits,
        clock: Callable[[], float],
        *,
        resolution: float,
        reads_back: bool,
        acknowledges: bool,
    ) -> None:
        self._limits, self._clock, self._arms = limits, clock, limits.arms
        self._resolution = resolution
        self._reads_back, self._acknowledges = reads_back, acknowledges
        self.refusals = 0
        self.read_back: dict[str, float] = {}
        self.measured: dict[str, float] = {}
        self._last_refusal = ""
        self._sent: deque[tuple[float, Pressures]] = deque()
        self._writing_since: float | None = None
        self._zero_since: float | None = None
        self._acknowledged_at = self._refused_at = clock()
        self._read_back_at: dict[str, float] = {}
        self._measured_at: dict[str, float] = {}
        self._mismatch_since: dict[str, float] = {}
        self._excess_since: dict[str, float] = {}

    def note_sent(self, pressure: Pressures | None) -> None:
        """Take note of set-points that left [Pa]; None when nothing was sent."""
        now = self._clock()
        if pressure is None:
            self._writing_since = self._zero_since = None
            self._sent.clear()
            return
        if self._writing_since is None:
            self._writing_since = now
            self._mismatch_since.clear()
        self._sent.append((now, pressure))
        while self._sent[0][0] < now - 2.0 * self._limits.rig_timeout and len(self._sent) > 1:
            self._sent.popleft()
        if any(pressure):
            self._zero_since = None
        elif self._zero_since is None:
            self._zero_since = now

    def note_read_back(self, arm: str, pressure: float, heard: float) -> None:
        """Take the set-point that the rig says it works to [Pa], heard at a steady time [s]."""
        now = self._clock()
        self.read_back[arm], self._read_back_at[arm] = pressure, heard
        if self._writing_since is None or arm not in self._arms:
            return
        tolerance = max(2.0 * self._resolution, 0.01 * self._limits.of(arm))
        index = self._arms.index(arm)
        # The rig may lag by the time it is allowed: each value sent within it is right.
        recent = [sent[index] for then, sent in self._sent if then >= now - self._limits.rig_timeout]
        recent.append(self._sent[-1][1][index])
        if min(recent) - tolerance <= pressure <= max(recent) + tolerance:
            self._mismatch_since.pop(arm, None)
        else:
            self._mismatch_since.setdefault(arm, now)

    def note_measured(self, arm: str, pressure: float, heard: float) -> None:
        """Take a measured gauge pressure [Pa], heard at a steady time [s]."""
        now = self._clock()
        self.measured[arm], self._measured_at[arm] = pressure, heard
        if arm in self._arms and pressure > (1.0 + MEASURED_TOLERANCE) * self._limits.of(arm):
            self._excess_since.setdefault(arm, now)
        else:
            self._excess_since.pop(arm, None)

    def note_acknowledged(self) -> None:
        """Take note that the rig confirmed a write."""
        self._acknowledged_at = self._clock()

    def note_refused(self, reason: str) -> None:
        """Take note that the rig refused a write, for a reason in its words."""
        self.refusals += 1
        self._last_refusal, self._refused_at = reason, self._clock()

    def fault(self) -> str:
        """Return what is wrong now, in words; '' while all is well."""
        now, timeout = self._clock(), self._limits.rig_timeout
        for arm, since in self._excess_since.items():
            if now - since >= _PERSISTENCE:
                value, highest = self.measured[arm], self._limits.of(arm)
                return f"{arm} measures {value / 1e3:.1f} kPa, above the limit of {highest / 1e3:.1f} kPa"
        if self._writing_since is None:
            return ""
        silence = now - max(self._writing_since, self._heard_at())
        # One event, one name: each check below fails too when nothing at all arrives.
        silent = f"the rig is silent for {silence:.2f} s" if silence > 0.5 * timeout else ""
        for arm, since in self._mismatch_since.items():
            if now - since > timeout:
                sent = self._sent[-1][1][self._arms.index(arm)]
                return silent or (
                    f"{arm} works to {self.read_back[arm] / 1e3:.1f} kPa, "
                    f"sent were {sent / 1e3:.1f} kPa: another controller, or ignored writes?"
                )
        since = self._writing_since
        if self._acknowledges and now - max(since, self._acknowledged_at) > timeout:
            why = (
                f"refuses set-points ({self._last_refusal})"
                if self._last_refusal
                else "confirms no set-point"
            )
            return silent or f"the rig {why} for {now - max(since, self._acknowledged_at):.2f} s"
        if self._reads_back:
            heard = min((self._read_back_at.get(arm, since) for arm in self._arms), default=since)
            if now - max(since, heard) > timeout:
                return silent or f"the rig reports no set-points for {now - max(since, heard):.2f} s"
        return ""

    def _heard_at(self) -> float:
        """Return the steady time of the last reading, read-back, acknowledgement or refusal [s]."""
        heard = (*self._measured_at.values(), *self._read_back_at.values())
        return max(self._acknowledged_at, self._refused_at, *heard)

    def zero_is_confirmed(self) -> bool:
        """Tell whether the rig confirmed a set-point of zero after zero was sent."""
        since = self._zero_since
        if since is None:
            return False
        if self._reads_back:
            return all(
                self._read_back_at.get(arm, -1.0) > since and abs(self.read_back[arm]) <= self._resolution
                for arm in self._arms
            )
        if self._acknowledges:
            return self._acknowledged_at > since
        return all(
            self._measured_at.get(arm, -1.0) > since
            and abs(self.measured[arm]) <= EMPTY * self._limits.of(arm)
            for arm in self._arms
        )

    def holding(self) -> str:
        """Return which arms hold pressure or work to a set-point, in words; '' for none."""
        words = []
        for arm in self._arms:
            measured, setting = self.measured.get(arm, 0.0), self.read_back.get(arm, 0.0)
            if measured > EMPTY * self._limits.of(arm):
                words.append(f"{arm} holds {measured / 1e3:.1f} kPa")
            elif setting > max(self._resolution, 0.01 * self._limits.of(arm)):
                words.append(f"{arm} works to {setting / 1e3:.1f} kPa")
        return ", ".join(words)

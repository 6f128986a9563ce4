"""The accelerations that a motion has gone through lately, and what they tell about those to come."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np

from ldcs_ros.schema.units import TIME_TOLERANCE

Point = tuple[float, np.ndarray]

# Commands come at a steady rate if two intervals between them differ by less than this share.
REGULAR = 0.01
# Points that are kept since the last jump; a longer interval has no use for those of the one before.
MOST_POINTS = 64


@dataclass(frozen=True)
class StagePredictor:
    """Accelerations of the free coordinates since they last jumped, as a command makes them do.

    Commands at a steady rate make every interval run like the one before; where its stages were at the same times,
    their accelerations are the best guess of the next ones. Otherwise the last two points are extrapolated.

    Attributes:
        since: Time of the jump [s].
        points: (time, acceleration) since then, in the order of their making; the last is the present one.
        length: Length of the interval before the jump [s]; 0 if there was none.
        before: (time since its jump, acceleration) of that interval in the order of time; empty if it says nothing.
        end: Acceleration just before the jump; None if there was none.
        drift: How far that had moved on since the jump before.
    """

    since: float
    points: tuple[Point, ...]
    length: float = 0.0
    before: tuple[Point, ...] = ()
    end: np.ndarray | None = None
    drift: np.ndarray | float = 0.0

    def jumped(self, time: float, a: np.ndarray) -> StagePredictor:
        """Return the trail after a jump at a time to accelerations a."""
        length = time - self.since
        before: tuple[Point, ...] = ()
        if len(self.points) < MOST_POINTS and abs(length - self.length) <= REGULAR * length:
            before = tuple(
                sorted(((when - self.since, value) for when, value in self.points), key=lambda p: p[0])
            )
        end = self.points[-1][1]
        drift = 0.0 if self.end is None else end - self.end
        return StagePredictor(time, ((time, a),), length, before, end, drift)

    def extended(self, points: list[Point]) -> StagePredictor:
        """Return the trail with more points."""
        return replace(self, points=(self.points + tuple(points))[-MOST_POINTS:])

    def guess(self, points: list[Point], time: float) -> np.ndarray:
        """Return the accelerations to expect at a time, given the trail's points and more that followed."""
        last = points[-1] if points else self.points[-1]
        earlier = self._earlier(time)
        if earlier is not None:
            if last[0] == self.since:
                # What jumps most (light links) has come to rest again before the first stage.
                return earlier + self.drift
            earlier_last = self._earlier(last[0])
            if earlier_last is not None:
                return last[1] + earlier - earlier_last
        known = [*self.points[-2:], *points][-2:]
        if len(known) < 2 or known[1][0] == known[0][0]:
            return last[1].copy()
        (t0, a0), (t1, a1) = known
        return a1 + (time - t1) / (t1 - t0) * (a1 - a0)

    def _earlier(self, time: float) -> np.ndarray | None:
        # What the interval before had at the same time after its jump; None if no stage was there: what a jump has
        # set off is too fast to be interpolated.
        elapsed = time - self.since
        after = bisect_left(self.before, elapsed - TIME_TOLERANCE, key=lambda point: point[0])
        if after == len(self.before) or self.before[after][0] > elapsed + TIME_TOLERANCE:
            return None
        return self.before[after][1]

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
        """Return the trail after a jump at a time to accelerations a, shape (n_free,)."""
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

    def guesses(self, times: np.ndarray) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Return how to guess the accelerations of each stage at its time from those of the stages before.

        Args:
            times: Of the start and the stages [s], shape (n_stages,).

        Returns:
            bend, shape (n_stages,), and offset: the guess of stage i is a_(i-1) + bend_i (a_(i-1) - a_(i-2)) +
            offset_i. The offset of the first stage holds what the trail's points tell.
        """
        bend, offset = np.zeros(len(times)), {}
        first = self._first_offset(times[1])
        if first is not None:
            offset[1] = first
        earlier = self._earlier(times[1])
        for i in range(2, len(times)):
            before, earlier = earlier, self._earlier(times[i])
            if before is not None and earlier is not None:
                offset[i] = earlier - before
            elif times[i - 1] != times[i - 2]:
                bend[i] = (times[i] - times[i - 1]) / (times[i - 1] - times[i - 2])
        return bend, offset

    def _first_offset(self, time: float) -> np.ndarray | None:
        last, a = self.points[-1]
        earlier = self._earlier(time)
        if earlier is not None:
            if last == self.since:
                # What jumps most (light links) has come to rest again before the first stage.
                return earlier + self.drift - a
            before = self._earlier(last)
            if before is not None:
                return earlier - before
        if len(self.points) < 2 or self.points[-2][0] == last:
            return None
        t0, a0 = self.points[-2]
        return (time - last) / (last - t0) * (a - a0)

    def _earlier(self, time: float) -> np.ndarray | None:
        # What the interval before had at the same time after its jump; None if no stage was there: what a jump has
        # set off is too fast to be interpolated.
        elapsed = time - self.since
        after = bisect_left(self.before, elapsed - TIME_TOLERANCE, key=lambda point: point[0])
        if after == len(self.before) or self.before[after][0] > elapsed + TIME_TOLERANCE:
            return None
        return self.before[after][1]

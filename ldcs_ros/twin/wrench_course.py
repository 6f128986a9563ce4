"""Wrenches that act for a while: risen, held and let go along the times that a request names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ldcs_ros.messages.cdr import nanoseconds

STAIR_TIME = 0.01
"""Length of a stair of a ramp [s]: commands are held, so that a ramp is a stair that a bag can tell."""
MOST_STAIRS = 200
"""Stairs of the longest ramp; a stair is then 0.5 % of the wrench."""


@dataclass(frozen=True)
class WrenchCourse:
    """A wrench and the share of it that is commanded, over time.

    Attributes:
        frame: Frame in which it acts: a point, or a point with '_aligned'.
        force: Full force [N].
        torque: Full torque [N m].
        shares: Times [ns], ascending, and the share that is held from then on.
    """

    frame: str
    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    shares: tuple[tuple[int, float], ...]

    @classmethod
    def of(
        cls,
        frame: str,
        force: Sequence[float],
        torque: Sequence[float],
        *,
        start: float,
        duration: float,
        ramp: float,
    ) -> WrenchCourse:
        """Return the course that begins at `start` [s].

        Each stair has the mean of the straight ramp over it: the impulse is that of the ramp exactly.

        Args:
            frame: Where it acts.
            force: Full force [N].
            torque: Full torque [N m].
            start: When it begins [s].
            duration: How long it acts, ramps included [s]; 0 for until it is replaced.
            ramp: How long it rises, and falls [s].
        """
        shares = {nanoseconds(start + time): share for time, share in _rise(ramp)}
        if duration > 0.0:
            falls = start + duration - ramp
            shares |= {nanoseconds(falls + time): 1.0 - share for time, share in _rise(ramp)}
        return cls(frame, _three(force), _three(torque), tuple(sorted(shares.items())))

    def at(self, share: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return force [N] and torque [N m] of a share."""
        return _three([share * f for f in self.force]), _three([share * t for t in self.torque])


class WrenchCourses:
    """The courses under way, one for each frame."""

    def __init__(self) -> None:
        self._courses: dict[str, WrenchCourse] = {}

    @property
    def next_time(self) -> float:
        """When a share changes next [s], infinity for never; a whole number of nanoseconds, as bags keep it."""
        return min((one.shares[0][0] for one in self._courses.values()), default=math.inf) / 1e9

    def put(self, course: WrenchCourse) -> None:
        """Follow a course, instead of the one that its frame has."""
        self._courses[course.frame] = course

    def drop(self, frame: str) -> None:
        """Follow the course of a frame no more."""
        self._courses.pop(frame, None)

    def clear(self) -> None:
        """Follow none."""
        self._courses.clear()

    def take(self, time: float) -> list[tuple[WrenchCourse, float]]:
        """Return the courses whose share changes up to a time [s], with the share that is to be held."""
        now = nanoseconds(time)
        changed = []
        for frame, course in list(self._courses.items()):
            past = [share for due, share in course.shares if due <= now]
            if not past:
                continue
            changed.append((course, past[-1]))
            left = course.shares[len(past) :]
            if left:
                self._courses[frame] = WrenchCourse(frame, course.force, course.torque, left)
            else:
                del self._courses[frame]
        return changed


def _rise(ramp: float) -> list[tuple[float, float]]:
    """Return times from the start [s] and shares of a ramp to 1."""
    stairs = min(MOST_STAIRS, math.ceil(ramp / STAIR_TIME))
    return [(ramp * k / stairs, (k + 0.5) / stairs) for k in range(stairs)] + [(ramp, 1.0)]


def _three(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return (x, y, z)

"""Wrenches that act for a while: risen, held and let go along the times that a request names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ldcs_ros.messages.cdr import nanoseconds

STEP_TIME = 0.01
"""Length of a step of a ramp [s]: commands are held, so that a bag can hold a ramp as steps."""
MAX_STEPS = 200
"""Steps of the longest ramp; a step is then 0.5 % of the wrench."""


@dataclass(frozen=True)
class WrenchProfile:
    """A wrench and the commanded fraction of it over time.

    Attributes:
        frame: Frame in which it acts: a point, or a point with '_aligned'.
        force: Full force [N].
        torque: Full torque [N m].
        fractions: Times [ns], ascending, and the fraction that is held from then on.
    """

    frame: str
    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    fractions: tuple[tuple[int, float], ...]

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
    ) -> WrenchProfile:
        """Return the profile that begins at `start` [s].

        Each step has the mean of the straight ramp over it: the impulse is that of the ramp exactly.

        Args:
            frame: Frame at which it acts.
            force: Full force [N].
            torque: Full torque [N m].
            start: Time of its begin [s].
            duration: Duration, ramps included [s]; 0 for until it is replaced.
            ramp: Duration of its rise, and of its fall [s].
        """
        fractions = {nanoseconds(start + time): fraction for time, fraction in _rise(ramp)}
        if duration > 0.0:
            falls = start + duration - ramp
            fractions |= {nanoseconds(falls + time): 1.0 - fraction for time, fraction in _rise(ramp)}
        return cls(frame, _three(force), _three(torque), tuple(sorted(fractions.items())))

    def at(self, fraction: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return force [N] and torque [N m] of a fraction."""
        return _three([fraction * f for f in self.force]), _three([fraction * t for t in self.torque])


class WrenchSchedule:
    """The wrench profiles in progress, one for each frame."""

    def __init__(self) -> None:
        self._profiles: dict[str, WrenchProfile] = {}

    @property
    def next_time(self) -> float:
        """Time of the next change [s], infinity for never; a whole number of nanoseconds, as bags keep it."""
        return min((one.fractions[0][0] for one in self._profiles.values()), default=math.inf) / 1e9

    def put(self, profile: WrenchProfile) -> None:
        """Follow a profile, instead of the present one of its frame."""
        self._profiles[profile.frame] = profile

    def drop(self, frame: str) -> None:
        """Drop the profile of a frame."""
        self._profiles.pop(frame, None)

    def clear(self) -> None:
        """Drop all profiles."""
        self._profiles.clear()

    def take(self, time: float) -> list[tuple[WrenchProfile, float]]:
        """Return the profiles whose fraction changes up to a time [s], with the fraction to hold."""
        now = nanoseconds(time)
        changed = []
        for frame, profile in list(self._profiles.items()):
            past = [fraction for due, fraction in profile.fractions if due <= now]
            if not past:
                continue
            changed.append((profile, past[-1]))
            left = profile.fractions[len(past) :]
            if left:
                self._profiles[frame] = WrenchProfile(frame, profile.force, profile.torque, left)
            else:
                del self._profiles[frame]
        return changed


def _rise(ramp: float) -> list[tuple[float, float]]:
    """Return times from the start [s] and fractions of a ramp to 1."""
    steps = min(MAX_STEPS, math.ceil(ramp / STEP_TIME))
    return [(ramp * k / steps, (k + 0.5) / steps) for k in range(steps)] + [(ramp, 1.0)]


def _three(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return (x, y, z)

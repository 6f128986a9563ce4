"""Step control: an adaptive PI controller, or a fixed step; neither lets a failed step out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.physics.inputs import HeldInputs
from ldcs_ros.physics.model import Motion

SMALLEST_STEP = 1e-9  # s; below it a simulation does not end
LARGEST_STEP = 1.0  # s
SAFETY = 0.9
# Errors of successive steps add up while the motion remembers them: a step may make this share of what is
# asked.
LOCAL_SHARE = 0.03
# After a corner in commands or drives the smooth step before it says little about the one after it.
CORNER_SHARE = 0.25


@dataclass(frozen=True)
class Pace:
    """What the controller remembers between steps.

    Attributes:
        h: Step that it wants to take next [s].
        ratio: Error of the last accepted step in units of the tolerance.
    """

    h: float
    ratio: float = 1.0


class AdaptiveSteps:
    """Keeps the error estimate of every step below the integrator's accuracy.

    PI control (Gustafsson 1991; Hairer and Wanner, section IV.2), with a dead zone in which the step stays as
    it is, so that factors are kept.
    """

    def __init__(self, integrator: Integrator) -> None:
        self.integrator = integrator
        self._power = 1.0 / integrator.error_order

    def corner(self, pace: Pace) -> Pace:
        """Return the pace after a command or drive changed abruptly."""
        return Pace(CORNER_SHARE * pace.h)

    def first(self, motion: Motion) -> Pace:
        """Return the pace at a start: the step in which the present acceleration moves something noticeably."""
        push = float(np.max(np.abs(motion.a), initial=0.0))
        return Pace(min(0.01, math.sqrt(self.integrator.accuracy / push)) if push > 0.0 else 0.01)

    def advance(self, motion: Motion, inputs: HeldInputs, pace: Pace, stop: float) -> tuple[Step, Pace]:
        """Take one step that does not pass the time `stop` [s]; return it and the pace for the next.

        Raises:
            DivergenceError: No step above the smallest one can be taken.
        """
        h, rejected = pace.h, False
        while True:
            h, clipped = _fit(motion.time, h, stop)
            try:
                step = self.integrator.step(motion, inputs, h)
            except StepFailure as failure:
                self.integrator.counters.rejected_steps += 1
                if h * failure.remedy < SMALLEST_STEP:
                    raise DivergenceError(
                        f"the simulation stopped at t = {motion.time:.9g} s: no step above {SMALLEST_STEP:g} s can be "
                        f"taken with {self.integrator.name}: {failure}; check the scene's stiffness, masses and loads"
                    ) from failure
                h, rejected = h * failure.remedy, True
                continue
            ratio = max(step.error / self.integrator.accuracy, 1e-4)
            if ratio <= 1.0:
                break
            self.integrator.counters.rejected_steps += 1
            self.integrator.counters.steps -= 1
            h, rejected = h * max(0.1, SAFETY * ratio**-self._power), True
        # A clipped step tells about its own length only; the pace before it stands if it was longer.
        grown = h * min(5.0, SAFETY * ratio ** (-0.7 * self._power) * pace.ratio ** (0.4 * self._power))
        if rejected:
            grown = min(grown, h)
        elif h <= grown < 1.2 * h:
            grown = h
        if clipped and not rejected:
            grown = max(grown, pace.h)
        if clipped:
            step = _landed(step, stop)
        return step, Pace(min(grown, LARGEST_STEP), ratio)


class FixedSteps:
    """Steps of one length; the last before a stop is shortened to it."""

    def __init__(self, integrator: Integrator, h: float) -> None:
        self.integrator, self.h = integrator, h

    def first(self, motion: Motion) -> Pace:
        """Return the pace at a start."""
        return Pace(self.h)

    def corner(self, pace: Pace) -> Pace:
        """Return the pace after a command or drive changed abruptly: the same."""
        return pace

    def advance(self, motion: Motion, inputs: HeldInputs, pace: Pace, stop: float) -> tuple[Step, Pace]:
        """Take one step that does not pass `stop`; raises DivergenceError if it cannot be taken."""
        h, clipped = (
            (stop - motion.time, True) if motion.time + self.h * (1 + 1e-6) >= stop else (self.h, False)
        )
        try:
            step = self.integrator.step(motion, inputs, h)
        except StepFailure as failure:
            self.integrator.counters.rejected_steps += 1
            raise DivergenceError(
                f"the simulation stopped at t = {motion.time:.9g} s: the fixed step dt = {h:g} s of "
                f"{self.integrator.name} failed: {failure}; reduce dt or use 'integrator: auto'"
            ) from failure
        return _landed(step, stop if clipped else self._tick(step.right.time)), pace

    def _tick(self, time: float) -> float:
        # Times on the grid of whole steps are exact multiples: a thousand additions do not drift.
        tick = round(time / self.h) * self.h
        return tick if abs(time - tick) <= 1e-6 * self.h else time


def _fit(time: float, h: float, stop: float) -> tuple[float, bool]:
    # Land on a stop exactly; two equal steps are better than a whole one and a sliver.
    left = stop - time
    if h >= left * 0.999:
        return left, True
    return (0.5 * left, False) if 2.0 * h > left else (h, False)


def _landed(step: Step, time: float) -> Step:
    # The step aimed at this time; rounding in time + h must not leave it a hair off.
    right = step.right
    return Step(step.left, Motion(time, right.q, right.u, right.a), step.error)

"""What the plain explicit methods share: stable parts of a step, and a watch on the limit while a run goes on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.integrators.spectrum import FastestMode, fastest_mode
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

# An adaptive step is made of parts of at most this share of the stability limit.
LIMIT_SHARE = 0.95
MOST_PARTS = 4000
# The limit is looked at again after so many force evaluations; the last mode found makes that cheap.
REVIEW_PERIOD = 200
FIRST_ACCURACY, REVIEW_ACCURACY = 2e-3, 1e-2
# An error h du in a rate counts as this share of it in a position.
RATE_SHARE = 0.25
# A step whose error estimate passes this share of a spacing has left the motion.
WILD_SHARE = 0.25


@dataclass
class WorkingState:
    """The coordinates while the parts of a step are made; changed in place.

    Attributes:
        time: Present time [s].
        q: Coordinates [m, rad], shape (n_coordinates,).
        u: Their rates, same shape.
        a: Accelerations of the free coordinates, shape (n_free,).
    """

    time: float
    q: np.ndarray
    u: np.ndarray
    a: np.ndarray


class StabilityMonitored(Integrator):
    """A method whose steps depend on the fastest mode; looks at it again every REVIEW_PERIOD evaluations."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._mode: FastestMode | None = None
        self._reviewed = 0

    @property
    def memory(self) -> Any:
        return self._mode, self._reviewed

    def recall(self, memory: Any) -> None:
        self._mode, self._reviewed = memory

    def limit(self, mode: FastestMode) -> float:
        """Return the largest stable step [s] for a fastest mode."""
        raise NotImplementedError

    def stability_limit(self, motion: Motion, inputs: HeldCommands) -> float:
        mode, count = fastest_mode(self.model, motion, inputs)
        self.counters.evaluations += count
        return self.limit(mode)

    def present_mode(self, motion: Motion, inputs: HeldCommands) -> FastestMode:
        """Return the fastest mode as last looked at.

        Raises:
            StepFailure: The accelerations near the motion are not finite.
        """
        if self._mode is None or self._reviewed >= REVIEW_PERIOD:
            accuracy = REVIEW_ACCURACY if self._mode else FIRST_ACCURACY
            mode, count = fastest_mode(self.model, motion, inputs, near=self._mode, accuracy=accuracy)
            self.counters.evaluations += count
            if not np.isfinite(mode.spectral_radius):
                self._mode = None
                raise StepFailure("the accelerations near the motion are not finite")
            self._mode, self._reviewed = mode, 0
        return self._mode

    def check_divergence(self, error: float) -> None:
        """Raise StepFailure if a step's error [m] says that the motion has left its course."""
        if not error <= WILD_SHARE * min(self.model.lattice.spacing):
            self._mode = None
            raise StepFailure("the motion grows without bound or left the finite numbers")


class Explicit(StabilityMonitored):
    """An explicit method: `part` takes one stable step, `step` as many equal ones as stability asks for.

    With adaptive control a step above the limit is divided into parts below it, so the limit costs no rejected
    steps. With a fixed step (`fixed_step`) nothing is divided: a limit that has fallen below it fails the step.
    """

    implicit: ClassVar[bool] = False
    evaluations_per_part: ClassVar[int]

    def part(self, working: WorkingState, inputs: HeldCommands, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Advance a working state by h [s]; return the estimated errors that this makes in q and u, shape (n_free,)."""
        raise NotImplementedError

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        limit = self.limit(self.present_mode(motion, inputs))
        if self.fixed_step and h > limit * (1.0 + 1e-9):
            raise StepFailure(
                f"{h:.4g} s is above the stability limit, now {limit:.3g} s", LIMIT_SHARE * limit / h
            )
        parts = 1 if h <= limit else math.ceil(h / (LIMIT_SHARE * limit))
        if parts > MOST_PARTS:
            raise StepFailure(f"{h:.3g} s takes {parts} parts of at most {limit:.3g} s", MOST_PARTS / parts)
        working = WorkingState(motion.time, motion.q.copy(), motion.u.copy(), motion.a)
        defect, rate_defect = np.zeros(len(self.model.free)), np.zeros(len(self.model.free))
        for k in range(parts):
            working.time = motion.time + h * k / parts
            made = self.part(working, inputs, h / parts)
            defect += made[0]
            rate_defect += made[1]
        self.counters.evaluations += parts * self.evaluations_per_part
        error = self.largest_displacement(np.maximum(np.abs(defect), RATE_SHARE * h * np.abs(rate_defect)))
        self.check_divergence(error)
        self._reviewed += parts * self.evaluations_per_part
        self.counters.steps += 1
        return Step(motion, Motion(motion.time + h, working.q, working.u, working.a), error)


def stable_radius(growth: Any, mode: FastestMode, *, most: float) -> float:
    """Return the largest h |mu| up to `most` for which |growth(h mu)| <= 1 holds all the way from 0."""
    if mode.spectral_radius == 0.0:
        return math.inf
    along = mode.eigenvalue / mode.spectral_radius
    radius = np.linspace(0.0, most, 2001)[1:]
    bad = np.abs(growth(radius * along)) > 1.0 + 1e-12
    return float(radius[np.argmax(bad)]) * 0.999 if bad.any() else most

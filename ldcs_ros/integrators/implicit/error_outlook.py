"""Where the velocities of a run's error lead: short violent steps make errors that show in positions much later."""

from __future__ import annotations

import numpy as np

from ldcs_ros.integrators.base import Counters, ErrorState
from ldcs_ros.integrators.implicit.error_kernels import largest_distance
from ldcs_ros.integrators.implicit.momenta import Momenta
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

# The implicit Euler step that a velocity error is followed for [s]: about 1 / omega of the slow modes of a sheet.
FOLLOWED = 0.03
# A step of this length and more shows velocity errors in its own positions [s].
LONG_STEP = 0.01
# A loose sheet is followed for this fraction of the time that has passed, or of the first second.
AHEAD = 0.5
SOONEST = 1.0  # s
# Steps for which the factors of that step are kept.
MOST_USES = 20


class ErrorOutlook:
    """The displacement that an error will reach as its velocities act.

    A velocity error e_u of a held sheet moves nodes by about H W^-1 M e_u, W = M - H C - H^2 K: damping and stiffness
    stop what they stop within H. Nothing stops the rigid part of a loose sheet's error: it goes on for seconds.
    """

    def __init__(self, system: LinearSystem) -> None:
        self._system, self._model = system, system.model
        self._factors: Factors | None = None
        self._uses = 0
        self.momenta = Momenta(system.model)

    @property
    def memory(self) -> tuple[Factors | None, int]:
        """What the next call depends on; hand it to `recall`."""
        return self._factors, self._uses

    def recall(self, memory: tuple[Factors | None, int]) -> None:
        """Take back a `memory`."""
        self._factors, self._uses = memory

    def distance(
        self, h: float, motion: Motion, inputs: HeldCommands, error: ErrorState, counters: Counters
    ) -> float:
        """Return the distance that an error will reach at the worst node [m], at least its own.

        Args:
            h: Length of the step that led to the error [s].
            motion: Motion at the end of that step.
            inputs: What is commanded.
            error: The error there.
            counters: Where factorings and solves are counted.
        """
        reached = error.distance
        if self._model.is_unconstrained:
            speed = self.momenta.speed(motion.q, self.momenta.of_error(motion, error))
            reached = max(reached, error.distance + AHEAD * max(motion.time, SOONEST) * speed)
        if h < LONG_STEP:
            shift = FOLLOWED * self._followed(motion, inputs, error.u, counters)
            reached = max(reached, float(largest_distance(self._model.free, shift, self._model.n_free_nodes)))
        return reached

    def _followed(
        self, motion: Motion, inputs: HeldCommands, u: np.ndarray, counters: Counters
    ) -> np.ndarray:
        """Return W^-1 M u [m/s] with kept factors."""
        where = motion.time, motion.q, motion.u, inputs, FOLLOWED
        kept = self._factors
        if kept is None or self._uses >= MOST_USES or self._system.links_turned(kept, motion.q):
            counters.factorisations += 1
            try:
                kept, self._uses = self._system.factor(*where, corotated=True), 0
            except np.linalg.LinAlgError:
                return u  # nothing that could be factored stops it
        self._factors, self._uses = kept, self._uses + 1
        counters.solves += 1
        return self._system.turn(kept, *where).solve(self._model.momentum(motion.q, u))

"""Linearly implicit Euler: first order, L-stable, one linear system a step and no iteration."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.integrators.explicit import RATE_SHARE
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion


class LinearlyImplicitEuler(Integrator):
    """Backward Euler with one Newton step (Baraff and Witkin, Large steps in cloth simulation, 1998).

    (M - h C - h^2 K) (u' - u) = h f(t + h, q + h u, u), q' = q + h u', with C and K taken at that argument.
    """

    name: ClassVar[str] = "linearly_implicit_euler"
    order: ClassVar[int] = 1
    error_order: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        self._system = LinearSystem(self.model)

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        model, free, end = self.model, self.model.free, motion.time + h
        q, u = motion.q.copy(), motion.u.copy()
        q[free] += h * u[free]
        model.prescribe(end, q, u)
        try:
            factors = self._system.factor(end, q, u, inputs, h)
        except np.linalg.LinAlgError as cause:
            raise StepFailure(str(cause)) from cause
        a = factors.solve(model.force(end, q, u, inputs))
        self.counters.factorisations += 1
        self.counters.evaluations += 1
        self.counters.solves += 1
        u[free] += h * a
        q[free] += h * h * a
        # Half of what the step's second-order terms are: h^2 a / 2 in q, h^2 a' / 2 in u.
        defect, rate_defect = 0.5 * h * h * np.abs(a), 0.5 * h * np.abs(a - motion.a)
        error = self.largest_displacement(np.maximum(defect, RATE_SHARE * h * rate_defect))
        if not np.isfinite(error):
            raise StepFailure("the step left the finite numbers")
        self.counters.steps += 1
        return Step(motion, Motion(end, q, u, a), error)

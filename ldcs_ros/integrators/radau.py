"""Radau IIA of order five by SciPy: an independent reference, not a fast method."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.integrators.first_order import FirstOrder
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

# SciPy's tolerances are for one of its own steps and for the root mean square over all coordinates.
TOLERANCE_SHARE = 0.1
LEAST_TOLERANCE = 1e-14
# A rate of 1 m/s lasts about this long in a sheet: errors in rates weigh by it [s].
RATE_TIME = 0.01


class Radau(Integrator):
    """Each step is `scipy.integrate.solve_ivp(method="Radau")` from its start to its end, within the tolerance.

    SciPy divides the step by its own error control, so the error follows the tolerance, not the length; with a
    fixed step `dt` is only how often it starts anew. L-stable.
    """

    name: ClassVar[str] = "radau"
    order: ClassVar[int] = 5
    error_order: ClassVar[int] = 4

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        from scipy.integrate import solve_ivp

        system, end = FirstOrder(self.model, motion, inputs), motion.time + h
        allowed = max(TOLERANCE_SHARE * tolerance, LEAST_TOLERANCE)
        n = len(self.model.free)
        absolute = np.concatenate([allowed / self._reach, allowed / (RATE_TIME * self._reach)])
        try:
            solution = solve_ivp(
                system.slope,
                (motion.time, end),
                system.start,
                method="Radau",
                jac=system.jacobian,
                rtol=1e-13,
                atol=absolute,
                # SciPy starts timidly; what is too long it rejects by itself.
                first_step=0.1 * (end - motion.time),
            )
        except (RuntimeError, ValueError) as error:
            # SuperLU on a matrix that is singular or not finite.
            raise StepFailure(f"SciPy's Radau: {error}") from error
        self.counters.evaluations += system.evaluations
        self.counters.factorisations += int(solution.nlu)
        if solution.status != 0 or not np.isfinite(solution.y[:, -1]).all():
            raise StepFailure(f"SciPy's Radau: {solution.message}")
        self.counters.steps += 1
        landed = system.motion(end, solution.y[:, -1])
        return Step(motion, landed, min(tolerance, self.largest_displacement(np.full(n, allowed))))

"""The classical Runge-Kutta method of fourth order: four force evaluations a step."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ldcs_ros.integrators.explicit import Explicit, WorkingState, stable_radius
from ldcs_ros.integrators.spectrum import FastestMode
from ldcs_ros.physics.inputs import HeldCommands

# The last stage's weight; moved to the evaluation at the step's end it leaves a method of order three.
SWAPPED_WEIGHT = 1.0 / 6.0


def growth(z: Any) -> Any:
    """Return the stability function 1 + z + z^2/2 + z^3/6 + z^4/24."""
    return 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))


class Rk4(Explicit):
    """Kutta's method for (q, u)' = (u, a(t, q, u)).

    Stable while |growth(h mu)| <= 1: h <= 2.785 / rho for a damped (real) fastest mode, 2.83 / rho for an undamped
    one. The embedded solution of order three takes the acceleration at the end instead of the last stage's.
    """

    name: ClassVar[str] = "rk4"
    order: ClassVar[int] = 4
    error_order: ClassVar[int] = 4
    evaluations_per_part: ClassVar[int] = 4

    def limit(self, mode: FastestMode) -> float:
        radius = stable_radius(growth, mode, most=3.0)
        return radius / mode.spectral_radius if mode.spectral_radius > 0.0 else radius

    def part(self, working: WorkingState, inputs: HeldCommands, h: float) -> tuple[np.ndarray, np.ndarray]:
        model, free, start = self.model, self.model.free, working.time
        q0, u0 = working.q[free], working.u[free]
        rates, pushes = [u0], [working.a]
        for share in (0.5, 0.5, 1.0):
            rate = u0 + share * h * pushes[-1]
            working.q[free] = q0 + share * h * rates[-1]
            working.u[free] = rate
            model.prescribe(start + share * h, working.q, working.u)
            rates.append(rate)
            pushes.append(model.accelerate(start + share * h, working.q, working.u, inputs))
        working.q[free] = q0 + h / 6.0 * (rates[0] + 2.0 * (rates[1] + rates[2]) + rates[3])
        working.u[free] = u0 + h / 6.0 * (pushes[0] + 2.0 * (pushes[1] + pushes[2]) + pushes[3])
        working.time = start + h
        working.a = model.accelerate(working.time, working.q, working.u, inputs)
        weight = SWAPPED_WEIGHT * h
        return weight * (rates[3] - working.u[free]), weight * (pushes[3] - working.a)

"""Semi-implicit (symplectic) Euler: first order, one force evaluation a step; what most simulators use."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from ldcs_ros.integrators.explicit import Explicit, WorkingState
from ldcs_ros.integrators.spectrum import FastestMode
from ldcs_ros.physics.inputs import HeldCommands


class SemiImplicitEuler(Explicit):
    """u' = u + h a(t, q, u), q' = q + h u'.

    For a mode x'' = -c x' - k x the matrix of a step has determinant 1 - h c and trace 2 - h c - h^2 k; both roots
    stay in the unit disc while h^2 k + 2 h c <= 4: h <= 2 / sqrt(k) without damping, 2 / c where damping rules.
    """

    name: ClassVar[str] = "semi_implicit_euler"
    order: ClassVar[int] = 1
    error_order: ClassVar[int] = 2
    evaluations_per_part: ClassVar[int] = 1

    def limit(self, mode: FastestMode) -> float:
        c, k = mode.damping, mode.stiffness
        return 4.0 / (c + math.sqrt(c * c + 4.0 * k)) if c + k > 0.0 else math.inf

    def part(self, working: WorkingState, inputs: HeldCommands, h: float) -> tuple[np.ndarray, np.ndarray]:
        free, before = self.model.free, working.a
        rate = working.u[free] + h * before
        working.u[free] = rate
        working.q[free] += h * rate
        working.time += h
        self.model.prescribe(working.time, working.q, working.u)
        working.a = self.model.accelerate(working.time, working.q, working.u, inputs)
        # The next terms of the Taylor series: h^2 a / 2 in q, h^2 a' / 2 in u.
        return 0.5 * h * h * before, 0.5 * h * (working.a - before)

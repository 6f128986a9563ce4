"""RKC2: second-order stabilised explicit Runge-Kutta-Chebyshev steps; no matrix, as many stages as stiffness asks."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from ldcs_ros.integrators.base import Step, StepFailure
from ldcs_ros.integrators.explicit import RATE_SHARE, StabilityMonitored
from ldcs_ros.integrators.spectrum import FastestMode
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

DAMPING = 2.0 / 13.0
MOST_STAGES = 400
# Where a step stops being stable is looked for among this many lengths.
TRIALS = 200


class Coefficients(NamedTuple):
    """The coefficients of s stages, in the paper's letters; arrays have shape (s + 1,) and start at stage 0."""

    mu: np.ndarray
    nu: np.ndarray
    mu_tilde: np.ndarray
    gamma_tilde: np.ndarray
    c: np.ndarray
    w0: float
    w1: float
    last: tuple[float, float]


@lru_cache(maxsize=MOST_STAGES)
def coefficients(s: int) -> Coefficients:
    """Return the coefficients of s >= 2 stages (Sommeijer, Shampine and Verwer 1997, section 2)."""
    w0 = 1.0 + DAMPING / s**2
    t, slope, bend = np.empty(s + 1), np.empty(s + 1), np.empty(s + 1)
    t[:2], slope[:2], bend[:2] = (1.0, w0), (0.0, 1.0), (0.0, 0.0)
    for j in range(2, s + 1):
        t[j] = 2.0 * w0 * t[j - 1] - t[j - 2]
        slope[j] = 2.0 * t[j - 1] + 2.0 * w0 * slope[j - 1] - slope[j - 2]
        bend[j] = 4.0 * slope[j - 1] + 2.0 * w0 * bend[j - 1] - bend[j - 2]
    w1 = slope[s] / bend[s]
    b, c = np.empty(s + 1), np.zeros(s + 1)
    b[2:] = bend[2:] / slope[2:] ** 2
    b[:2] = b[2]
    c[2:] = w1 * bend[2:] / slope[2:]
    c[1] = b[1] * w1
    mu, nu, mu_tilde, gamma_tilde = (np.zeros(s + 1) for _ in range(4))
    mu_tilde[1] = b[1] * w1
    mu[2:], nu[2:] = 2.0 * b[2:] * w0 / b[1:-1], -b[2:] / b[:-2]
    mu_tilde[2:] = 2.0 * b[2:] * w1 / b[1:-1]
    gamma_tilde[2:] = -(1.0 - b[1:-1] * t[1:-1]) * mu_tilde[2:]
    return Coefficients(mu, nu, mu_tilde, gamma_tilde, c, w0, w1, (1.0 - b[s] * t[s], float(b[s])))


def stages(radius: float) -> int:
    """Return how many stages are stable for a real negative h mu of this magnitude; at least 2."""
    return max(2, 1 + math.ceil(math.sqrt(1.54 * radius + 1.0)))


def growth(z: complex, s: int) -> complex:
    """Return the stability function a_s + b_s T_s(w0 + w1 z)."""
    known = coefficients(s)
    a, b = known.last
    before, now = 1.0 + 0.0j, known.w0 + known.w1 * z
    for _ in range(2, s + 1):
        before, now = now, 2.0 * (known.w0 + known.w1 * z) * now - before
    return a + b * now


@compiled
def _combine(mu, nu, mu_h, gamma_h, start, near, far, push, first):  # type: ignore[no-untyped-def]
    rest = 1.0 - mu - nu
    for i in range(start.size):
        far[i] = rest * start[i] + mu * near[i] + nu * far[i] + mu_h * push[i] + gamma_h * first[i]


class Rkc2(StabilityMonitored):
    """The Chebyshev recursion for (q, u)' = (u, a(t, q, u)) with its embedded estimate.

    Stable on the negative real axis up to |h mu| = 0.653 s^2 with s stages, so the cost of a step grows as the root
    of its length: made for damped sheets. Beside the axis the region is narrow: a fast mode that is hardly
    damped limits the step instead.
    """

    name: ClassVar[str] = "rkc2"
    order: ClassVar[int] = 2
    error_order: ClassVar[int] = 3

    def limit(self, mode: FastestMode) -> float:
        radius = mode.spectral_radius
        if radius == 0.0:
            return math.inf
        most = 0.653 * (MOST_STAGES - 1) ** 2 / radius
        if mode.eigenvalue.imag == 0.0:
            return most
        lengths = np.geomspace(min(1e-2 / radius, most), most, TRIALS)
        for h in lengths:
            # The recursion grows by up to this much while a slow swing is followed to second order.
            if abs(growth(h * mode.eigenvalue, stages(h * radius))) > 1.0 + 1e-9:
                return float(h)
        return most

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        model, free, n = self.model, self.model.free, len(self.model.free)
        mode = self.present_mode(motion, inputs)
        limit = self.limit(mode)
        if not h <= limit * (1.0 + 1e-9):
            raise StepFailure(f"{h:.4g} s is above the stability limit, now {limit:.3g} s", 0.9 * limit / h)
        s = stages(h * mode.spectral_radius)
        known = coefficients(s)
        q, u = motion.q.copy(), motion.u.copy()
        start, first, push = (
            np.concatenate([q[free], u[free]]),
            np.concatenate([u[free], motion.a]),
            np.empty(2 * n),
        )
        far, near = start.copy(), start + known.mu_tilde[1] * h * first
        for j in range(2, s + 1):
            time = motion.time + known.c[j - 1] * h
            q[free], u[free] = near[:n], near[n:]
            model.prescribe(time, q, u)
            push[:n], push[n:] = near[n:], model.accelerate(time, q, u, inputs)
            mu_h, gamma_h = known.mu_tilde[j] * h, known.gamma_tilde[j] * h
            _combine(known.mu[j], known.nu[j], mu_h, gamma_h, start, near, far, push, first)
            near, far = far, near
        end = motion.time + h
        q[free], u[free] = near[:n], near[n:]
        model.prescribe(end, q, u)
        a = model.accelerate(end, q, u, inputs)
        self.counters.evaluations += s
        self._reviewed += s
        defect = 0.8 * (start - near) + 0.4 * h * (first + np.concatenate([near[n:], a]))
        error = self.largest_displacement(np.maximum(np.abs(defect[:n]), RATE_SHARE * h * np.abs(defect[n:])))
        self.check_divergence(error)
        self.counters.steps += 1
        return Step(motion, Motion(end, q, u, a), error)

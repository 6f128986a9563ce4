"""The engine of the ESDIRK methods: stages by simplified Newton iterations with kept factors."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.integrators.linear import Factors, LinearSystem
from ldcs_ros.integrators.tableaux import Tableau
from ldcs_ros.physics.inputs import HeldInputs
from ldcs_ros.physics.model import Model, Motion

# An iteration stops when what is left of it is this share of the step's tolerance: its error then hides in
# the error estimate's own uncertainty.
ITERATION_SHARE = 0.02
MOST_ITERATIONS = 10
# Above this contraction rate new factors cost less than the iterations that they save (measured on `arc`).
SLOW_RATE = 0.25
# Kept factors are used while the step is within this ratio of the one that they were made for.
STEP_RATIO = 1.35
# Contraction rate to expect of fresh factors, until one is measured.
FRESH_RATE = 0.1
# Where in the step Newton's matrix is taken.
MIDDLE = 0.5
# Accelerations that the first guess of a stage is extrapolated from.
GUESS_POINTS = 2


class Dirk(Integrator):
    """q'' = M^-1 f as a first-order system in (q, q'), solved for the stage accelerations A_i.

    With h the step, g the tableau's diagonal and q*, u* what the stages before give,

        u_i = u* + h g A_i,     q_i = q* + h g u_i,     M(q_i) A_i - f(t_i, q_i, u_i) = 0.

    Newton's matrix is W = M - h g df/du - (h g)^2 df/dq, symmetric positive definite for a damped structure;
    it is factored at the start of a step and kept until the contraction rate or the step size says otherwise
    (Hairer and Wanner, Solving ODEs II, section IV.8). The last stage is the solution (stiffly accurate), its
    A the new acceleration. The error estimate is h sum d_i u_i over the positions of all nodes.
    """

    tableau: ClassVar[Tableau]

    def __init__(self, model: Model, accuracy: float) -> None:
        super().__init__(model, accuracy)
        self._system = LinearSystem(model)
        self._factors: Factors | None = None
        self._rate = FRESH_RATE
        self._past: tuple[tuple[float, np.ndarray], ...] = ()
        n = model.n_free_nodes
        # Angles count as displacements of an arm's tip.
        self._reach = np.ones(len(model.free))
        self._reach[n:] = model.lattice.size[0]

    @property
    def memory(self) -> Any:
        return self._factors, self._rate, self._past

    def recall(self, memory: Any) -> None:
        self._factors, self._rate, self._past = memory

    def _renew(self, motion: Motion, inputs: HeldInputs, h: float) -> Factors:
        """Factor Newton's matrix at a guess of the middle of the step: half as far from its ends as its start is."""
        self.counters.factorisations += 1
        free, ahead = self.model.free, MIDDLE * h
        q, u = motion.q.copy(), motion.u.copy()
        q[free] += ahead * motion.u[free]
        self.model.prescribe(motion.time + ahead, q, u)
        try:
            self._factors = self._system.factor(motion.time + ahead, q, u, inputs, self.tableau.diagonal * h)
        except np.linalg.LinAlgError as error:
            self._factors = None
            raise StepFailure(str(error)) from error
        self._rate = FRESH_RATE
        return self._factors

    def step(self, motion: Motion, inputs: HeldInputs, h: float) -> Step:
        rate_step = self.tableau.diagonal * h
        kept = self._factors
        fresh = (
            kept is None
            or self._rate > SLOW_RATE
            or not 1 / STEP_RATIO <= rate_step / kept.rate_step <= STEP_RATIO
        )
        factors = self._renew(motion, inputs, h) if fresh or kept is None else kept
        past = self._past
        try:
            return self._stages(motion, inputs, h, factors)
        except StepFailure:
            self._past = past
            if fresh:
                self._factors = None
                raise
        return self._stages(motion, inputs, h, self._renew(motion, inputs, h))

    def _stages(self, motion: Motion, inputs: HeldInputs, h: float, factors: Factors) -> Step:
        tableau, free = self.tableau, self.model.free
        n_stages = len(tableau.c)
        rates, accelerations = np.empty((n_stages, len(free))), np.empty((n_stages, len(free)))
        q0, rates[0], accelerations[0] = motion.q[free], motion.u[free], motion.a
        past = [point for point in self._past if point[0] < motion.time][-GUESS_POINTS + 1 :] + [
            (motion.time, motion.a)
        ]
        q, u = motion.q.copy(), motion.u.copy()
        worst = 0.0
        for i in range(1, n_stages):
            time = motion.time + tableau.c[i] * h
            self.model.prescribe(time, q, u)
            q_known = q0 + h * (tableau.a[i, :i] @ rates[:i])
            u_known = rates[0] + h * (tableau.a[i, :i] @ accelerations[:i])
            guess = _extrapolate(past[-GUESS_POINTS:], time)
            a, rate = self._solve(time, q, u, q_known, u_known, guess, inputs, tableau.diagonal * h, factors)
            worst = max(worst, rate)
            rates[i], accelerations[i] = u[free], a
            past.append((time, a))
        self._rate = worst
        self._past = tuple(past[-GUESS_POINTS - 1 :])
        estimate = h * (tableau.error_weights @ rates)
        error = float(np.max(np.abs(estimate) * self._reach, initial=0.0))
        self.counters.steps += 1
        return Step(motion, Motion(motion.time + h, q, u, accelerations[-1]), error)

    def _solve(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        q_known: np.ndarray,
        u_known: np.ndarray,
        a: np.ndarray,
        inputs: HeldInputs,
        rate_step: float,
        factors: Factors,
    ) -> tuple[np.ndarray, float]:
        """Write the stage's q and u; return its acceleration and the worst contraction rate seen."""
        free, model = self.model.free, self.model
        allowed = ITERATION_SHARE * self.accuracy
        # Until two iterations have measured it: the last rate known, and what the step's change since
        # factoring does.
        mismatch = abs(1.0 - (rate_step / factors.rate_step) ** 2)
        before, rate = np.inf, min(max(self._rate, mismatch, 0.02), 0.9)
        for iteration in range(MOST_ITERATIONS):
            u[free] = u_known + rate_step * a
            q[free] = q_known + rate_step * u[free]
            residual = model.force(time, q, u, inputs) - model.momentum(q, a)
            change = factors.solve(residual)
            self.counters.evaluations += 1
            self.counters.solves += 1
            moved = rate_step**2 * float(np.max(np.abs(change) * self._reach, initial=0.0))
            if not moved < 1e6:
                raise StepFailure(f"the iteration of a stage at t = {time:.9g} s left the finite numbers")
            a = a + change
            if iteration > 0:
                rate = moved / before if before > 0.0 else 0.0
                if rate > 2.0 or (iteration > 3 and rate > 0.95):
                    break
            if moved == 0.0 or (rate < 1.0 and moved * rate / (1.0 - rate) <= allowed):
                u[free] = u_known + rate_step * a
                q[free] = q_known + rate_step * u[free]
                return a, rate
            before = moved
        raise StepFailure(f"the iteration of a stage at t = {time:.9g} s does not converge (rate {rate:.2g})")


def _extrapolate(points: list[tuple[float, np.ndarray]], time: float) -> np.ndarray:
    """Return the value at a time of the polynomial through points (time, value)."""
    result = np.zeros_like(points[0][1])
    for i, (t_i, value) in enumerate(points):
        weight = 1.0
        for j, (t_j, _) in enumerate(points):
            if j != i:
                weight *= (time - t_j) / (t_i - t_j)
        result += weight * value
    return result

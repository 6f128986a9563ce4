"""ROS34PW2: a third-order L-stable Rosenbrock-W method; four linear systems a step, no iteration, kept factors."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np

from ldcs_ros.integrators.base import Integrator, Step, StepFailure
from ldcs_ros.integrators.explicit import RATE_SHARE
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

GAMMA = 0.435866521508459
# alpha, Gamma, b and the embedded b of Rang and Angermann (2005), table 6; stiffly accurate, W-conditions to order 3.
ALPHA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [0.87173304301691801, 0.0, 0.0, 0.0],
        [0.84457060015369423, -0.11299064236484185, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
)
COUPLING = np.array(
    [
        [GAMMA, 0.0, 0.0, 0.0],
        [-0.87173304301691801, GAMMA, 0.0, 0.0],
        [-0.90338057013044082, 0.054180672388095326, GAMMA, 0.0],
        [0.24212380706095346, -1.2232505839045147, 0.54526025533510214, GAMMA],
    ]
)
WEIGHTS = np.array([0.24212380706095346, -1.2232505839045147, 1.545260255335102, GAMMA])
EMBEDDED = np.array([0.37810903145819369, -0.096042292212423178, 0.5, 0.2179332607542295])

# In the unknowns w = Gamma k no stage multiplies by the Jacobian (Hairer and Wanner II, section IV.7).
_INVERSE = np.linalg.inv(COUPLING)
_STATE = ALPHA @ _INVERSE
_CARRIED = np.diag(np.diag(_INVERSE)) - _INVERSE
_RESULT = WEIGHTS @ _INVERSE
_DEFECT = _RESULT - EMBEDDED @ _INVERSE
# Factors serve while the step is within this ratio of theirs, and for so many steps.
STEP_RATIO = 1.25
MOST_USES = 2
# Step of the difference for d a / dt, as a share of h.
TIME_OFFSET = 0.01


class Kept(NamedTuple):
    """Factors of M - g C - g^2 K, with what they were made of and how often they have served."""

    factors: Factors
    by_rate: Any
    q: np.ndarray
    uses: int
    start: float


class RosenbrockW(Integrator):
    """A Rosenbrock method with a matrix A near dF/dy.

    For y = (q, u), F = (u, a) and g = h gamma:

        (1 / g - A) w_i = F(t_i, y_0 + sum a_ij w_j) + sum (c_ij / h) w_j + h gamma_i F_t,    y_1 = y_0 + sum m_i w_i.

    With w = (p, v) and r1, r2 the right sides of q and u, it takes one system of the size of q for each stage:
    (M - g C - g^2 K) s = M (r1 + g r2) - g C r1, p = g s, v = s - r1. A W-method keeps its order with old or
    approximate C and K, so factors are kept over steps of about the same length.
    """

    name: ClassVar[str] = "rosenbrock_w"
    order: ClassVar[int] = 3
    error_order: ClassVar[int] = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        self._system = LinearSystem(self.model)
        self._kept: Kept | None = None

    @property
    def memory(self) -> Any:
        return self._kept

    def recall(self, memory: Any) -> None:
        self._kept = memory

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        model, free, n = self.model, self.model.free, len(self.model.free)
        g = GAMMA * h
        kept = self._present(motion, inputs, g)
        # Factors of another g are those of C and K scaled by the ratio: the product must use the same C.
        old = kept.factors.rate_step
        q0, u0 = motion.q[free], motion.u[free]
        drift = self._drift(motion, inputs, h)
        p, v = np.zeros((4, n)), np.zeros((4, n))
        q, u, a = motion.q.copy(), motion.u.copy(), motion.a
        shares, slopes = ALPHA.sum(axis=1), COUPLING.sum(axis=1)
        for i in range(4):
            if i > 0:
                time = motion.time + shares[i] * h
                q[free], u[free] = q0 + _STATE[i, :i] @ p[:i], u0 + _STATE[i, :i] @ v[:i]
                model.prescribe(time, q, u)
                a = model.accelerate(time, q, u, inputs)
            r1 = u[free] + (_CARRIED[i, :i] / h) @ p[:i]
            r2 = a + (_CARRIED[i, :i] / h) @ v[:i] + h * slopes[i] * drift
            s = kept.factors.solve(model.momentum(kept.q, r1 + g * r2) - old * (kept.by_rate @ r1))
            p[i], v[i] = g * s, s - r1
        end = motion.time + h
        q[free], u[free] = q0 + _RESULT @ p, u0 + _RESULT @ v
        model.prescribe(end, q, u)
        a = model.accelerate(end, q, u, inputs)
        self.counters.evaluations += 5
        self.counters.solves += 4
        error = self.largest_displacement(
            np.maximum(np.abs(_DEFECT @ p), RATE_SHARE * h * np.abs(_DEFECT @ v))
        )
        if not (np.isfinite(error) and np.isfinite(a).all()):
            self._kept = None
            raise StepFailure("the step left the finite numbers")
        self.counters.steps += 1
        return Step(motion, Motion(end, q, u, a), error)

    def _present(self, motion: Motion, inputs: HeldCommands, g: float) -> Kept:
        kept = self._kept
        # A second step from the same start is a rejected one: old factors may be to blame.
        if kept is not None and kept.uses < MOST_USES and kept.start != motion.time:
            if 1.0 / STEP_RATIO <= g / kept.factors.rate_step <= STEP_RATIO:
                self._kept = kept._replace(uses=kept.uses + 1, start=motion.time)
                return self._kept
        from scipy import sparse

        self.counters.factorisations += 1
        where = (motion.time, motion.q, motion.u, inputs)
        try:
            factors = self._system.factor(*where, g)
        except np.linalg.LinAlgError as cause:
            raise StepFailure(str(cause)) from cause
        _, by_rate = self.model.jacobian(*where, positive_definite=False)
        rows, columns = self.model.jacobian_pattern
        used, n = (rows >= 0) & (columns >= 0), len(self.model.free)
        matrix = sparse.coo_matrix((by_rate[used], (rows[used], columns[used])), shape=(n, n)).tocsr()
        self._kept = Kept(factors, 0.5 * (matrix + matrix.T).tocsr(), motion.q, 1, motion.time)
        return self._kept

    def _drift(self, motion: Motion, inputs: HeldCommands, h: float) -> np.ndarray:
        """Return the partial derivative of the accelerations by time (drives, valves) [m/s^3], shape (n_free,)."""
        q, u, ahead = motion.q.copy(), motion.u.copy(), TIME_OFFSET * h
        self.model.prescribe(motion.time + ahead, q, u)
        self.counters.evaluations += 1
        change: np.ndarray = self.model.accelerate(motion.time + ahead, q, u, inputs) - motion.a
        return change / ahead

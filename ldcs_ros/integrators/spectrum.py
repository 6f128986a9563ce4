"""The fastest mode of a model near a motion, found from force differences alone: what limits explicit steps."""

from __future__ import annotations

import cmath
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion

MOST_ITERATIONS = 40
CALM = 3  # so many changes below the asked one in a row end the iteration
# Offsets of the differences: small against a spacing, large against rounding.
POSITION_OFFSET, RATE_OFFSET = 1e-7, 1e-3  # m, m/s
# A new direction below this share of the eigenvalue is rounding: all directions have been seen.
LEAST_NORM = 1e-10
# Lanczos approaches from below; what is found is taken to be larger by this factor.
MARGIN = 1.01


@dataclass(frozen=True)
class FastestMode:
    """The mode x'' = -c x' - k x that changes fastest, with the vectors that found it.

    Attributes:
        damping: Largest eigenvalue c of -M^-1 d(force)/du [1/s].
        stiffness: Largest eigenvalue k of -M^-1 d(force)/dq [1/s^2].
        by_rate: Eigenvector of c, shape (n_free,).
        by_position: Eigenvector of k, shape (n_free,).
    """

    damping: float
    stiffness: float
    by_rate: np.ndarray
    by_position: np.ndarray

    @property
    def eigenvalue(self) -> complex:
        """The faster root of mu^2 + c mu + k = 0 [1/s]; dampers parallel to all springs make it exact."""
        return -0.5 * (self.damping + cmath.sqrt(self.damping**2 - 4.0 * self.stiffness))

    @property
    def spectral_radius(self) -> float:
        """Its magnitude [1/s]."""
        return abs(self.eigenvalue)


def fastest_mode(
    model: Model,
    motion: Motion,
    inputs: HeldCommands,
    *,
    near: FastestMode | None = None,
    accuracy: float = 2e-3,
) -> tuple[FastestMode, int]:
    """Return the fastest mode and how many force evaluations finding it took.

    The Lanczos process on differences of accelerations, in the inner product of the mass matrix; it is power
    iteration that forgets nothing, so it also separates eigenvalues that lie close together.

    Args:
        model: The model.
        motion: Where.
        inputs: What is commanded.
        near: A mode found before, to start from.
        accuracy: Relative change of the eigenvalues at which to stop.
    """
    rest = model.accelerate(motion.time, motion.q, motion.u, inputs)

    def slope(which: str, offset: float) -> Callable[[np.ndarray], np.ndarray]:
        def apply(direction: np.ndarray) -> np.ndarray:
            scale = offset / float(np.max(np.abs(direction)))
            q, u = motion.q.copy(), motion.u.copy()
            (q if which == "q" else u)[model.free] += scale * direction
            return (rest - model.accelerate(motion.time, q, u, inputs)) / scale

        return apply

    def weigh(vector: np.ndarray) -> np.ndarray:
        return model.momentum(motion.q, vector)

    # A start without symmetry holds something of every mode.
    start = np.random.default_rng(0).normal(size=len(model.free))
    guess = (start, start) if near is None else (near.by_rate + 0.01 * start, near.by_position + 0.01 * start)
    damping, by_rate, first = _largest(slope("u", RATE_OFFSET), weigh, guess[0], accuracy)
    stiffness, by_position, second = _largest(slope("q", POSITION_OFFSET), weigh, guess[1], accuracy)
    mode = FastestMode(MARGIN * max(damping, 0.0), MARGIN * max(stiffness, 0.0), by_rate, by_position)
    return mode, 1 + first + second


def _largest(
    apply: Callable[[np.ndarray], np.ndarray],
    weigh: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    accuracy: float,
) -> tuple[float, np.ndarray, int]:
    basis: list[np.ndarray] = []
    weighed: list[np.ndarray] = []
    projected = np.zeros((MOST_ITERATIONS, MOST_ITERATIONS))
    vector, value, before, count, calm = start, 0.0, np.inf, 0, 0
    for count in range(1, min(MOST_ITERATIONS, len(start)) + 1):
        heavy = weigh(vector)
        norm = float(np.sqrt(vector @ heavy))
        if not np.isfinite(norm):
            return np.inf, start, count
        if norm <= LEAST_NORM * abs(value):
            break
        basis.append(vector / norm)
        weighed.append(heavy / norm)
        vector = apply(basis[-1])
        for _ in range(2):  # the second pass takes away what rounding left
            for i, other in enumerate(weighed):
                share = float(other @ vector)
                projected[i, count - 1] += share
                vector = vector - share * basis[i]
        values, vectors = np.linalg.eigh(projected[:count, :count], UPLO="U")
        value, top = float(values[-1]), vectors[:, -1]
        calm = calm + 1 if abs(value - before) <= accuracy * abs(value) else 0
        if calm == CALM:
            break
        before = value
    return value, np.array(basis).T @ top, count

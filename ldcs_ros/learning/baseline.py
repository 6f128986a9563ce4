"""A baseline without learning: feedback by the sensitivities of the rest state."""

from __future__ import annotations

import numpy as np

from ldcs_ros.learning.environment import SurfaceEnv

WEAKEST = 0.05
"""Directions in which the point moves by less than this fraction of the strongest one are left alone."""
GAIN = 2.5
"""The gain k [1/s]. A larger one follows faster and excites the sheet."""


class LinearFeedback:
    """a' = a + J+ (v dt + k e dt): target's velocity v, error e, static sensitivities J in the middle of the range.

    It takes one observation or a batch of them, and keeps nothing between two calls: the last action is observed.

    Args:
        env: The environment, which says J and the scales.
    """

    def __init__(self, env: SurfaceEnv) -> None:
        self._count = env.drives.count
        self._step = env.length * env.period * np.linalg.pinv(env.slopes(), rcond=WEAKEST)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action of an observation, shape (..., n) -> (..., n_arms)."""
        error, velocity = observation[..., 0:3], observation[..., 3:6]
        last = observation[..., -self._count :]
        action = last + (velocity + GAIN * error) @ self._step.T
        return np.clip(action, -1.0, 1.0).astype(np.float32)

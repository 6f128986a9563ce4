"""The vector work of a stage's iteration: placing its coordinates, measuring changes, Broyden's updates."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.compiled import compiled

MOST_UPDATES = 12
# An iteration may grow once, while the rank-one updates learn; beyond this it is given up.
WILD_RATE = 4.0
# A smaller denominator would amplify rounding: that update is left out.
LEAST_DENOMINATOR = 0.1


@compiled
def place(free, q_known, u_known, a, rate_step, q, u):  # type: ignore[no-untyped-def]
    """Write u = u_known + h a and q = q_known + h u at the free coordinates."""
    for i in range(free.size):
        rate = u_known[i] + rate_step * a[i]
        u[free[i]] = rate
        q[free[i]] = q_known[i] + rate_step * rate


@compiled
def largest(values, reach):  # type: ignore[no-untyped-def]
    """Return max |values| reach, infinite if a value is not finite."""
    most = 0.0
    for i in range(values.size):
        size = abs(values[i]) * reach[i]
        if not size < np.inf:
            return np.inf
        most = max(most, size)
    return most


@compiled
def apply_updates(before, after, squares, count, reach, z):  # type: ignore[no-untyped-def]
    """Turn z = W^-1 residual into the next step, in place, with the first `count` updates."""
    for j in range(count):
        share = 0.0
        for i in range(z.size):
            share += before[j, i] * reach[i] * reach[i] * z[i]
        share /= squares[j]
        for i in range(z.size):
            z[i] += share * after[j, i]


@compiled
def extend_updates(step, reach, z, before, after, squares, count):  # type: ignore[no-untyped-def]
    """Learn an update from a step and the one z that follows, which it changes; return whether it was kept."""
    square = share = 0.0
    for i in range(z.size):
        weight = reach[i] * reach[i] * step[i]
        square += weight * step[i]
        share += weight * z[i]
    denominator = 1.0 - share / square if square > 0.0 else 0.0
    if not denominator > LEAST_DENOMINATOR:
        return False
    for i in range(z.size):
        z[i] /= denominator
        before[count, i] = step[i]
        after[count, i] = z[i]
    squares[count] = square
    return True


class BroydenUpdates:
    """Broyden's "good" rank-one updates of kept factors, from the steps alone (Kelley 1995, section 7.3).

    H_{k+1} = (1 + s_{k+1} s_k^T / |s_k|^2) H_k, H_0 = W^-1. They learn how far the stage's matrix has moved from
    the factored one in the few directions that matter, so they are kept from stage to stage until the next factoring.

    Attributes:
        before: The steps s_k, shape (MOST_UPDATES, n).
        after: The steps s_{k+1}, same shape.
        squares: |s_k|^2, shape (MOST_UPDATES,).
        count: Number of updates.
    """

    def __init__(self, reach: np.ndarray) -> None:
        n = len(reach)
        self._reach = reach
        self.before, self.after = np.empty((MOST_UPDATES, n)), np.empty((MOST_UPDATES, n))
        self.squares = np.empty(MOST_UPDATES)
        self.count = 0

    def clear(self) -> None:
        """Forget all updates."""
        self.count = 0

    def step(self, z: np.ndarray, previous: np.ndarray | None) -> np.ndarray:
        """Turn z = W^-1 residual into the next step, in place; learn from the stage's step before it, if any."""
        apply_updates(self.before, self.after, self.squares, self.count, self._reach, z)
        if previous is not None and self.count < MOST_UPDATES:
            self.count += extend_updates(
                previous, self._reach, z, self.before, self.after, self.squares, self.count
            )
        return z

    @property
    def memory(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Copies of the updates for `recall`: vectors, shape (count, n) twice, and squares, shape (count,)."""
        n = self.count
        return self.before[:n].copy(), self.after[:n].copy(), self.squares[:n].copy()

    def recall(self, memory: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """Take back a `memory`, with its shapes."""
        self.count = len(memory[2])
        for target, source in zip((self.before, self.after, self.squares), memory, strict=True):
            target[: self.count] = source

"""Least squares with linear inequalities."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls


def constrained_least_squares(
    matrix: np.ndarray, right: np.ndarray, limits: np.ndarray, bounds: np.ndarray
) -> np.ndarray:
    """Return the x that minimises |matrix x - right| under limits x >= bounds, shape (n,).

    By a change of variables to the shortest vector under inequalities, which a non-negative least squares problem
    gives (Lawson and Hanson, Solving Least Squares Problems, chapter 23).

    Args:
        matrix: Of full column rank, shape (m, n).
        right: Shape (m,).
        limits: Shape (n_limits, n).
        bounds: Shape (n_limits,).

    Raises:
        ValueError: The inequalities contradict one another.
    """
    orthogonal, upper = np.linalg.qr(matrix)
    free = orthogonal.T @ right
    turned = solve_triangular(upper, limits.T, trans="T").T
    gap = bounds - turned @ free
    if (gap <= 0.0).all():
        return np.asarray(solve_triangular(upper, free))
    scale = max(float(np.abs(gap).max()), 1e-300)
    system = np.vstack([turned.T, gap / scale])
    target = np.zeros(len(system))
    target[-1] = 1.0
    dual, distance = nnls(system, target, maxiter=30 * system.shape[1])
    rest = system @ dual - target
    if distance < 1e-10 or rest[-1] == 0.0:
        raise ValueError("the bounds and the slew rates leave no course")
    return np.asarray(solve_triangular(upper, free - scale * rest[:-1] / rest[-1]))

"""First and total Sobol indices of a sweep, by SciPy from samples of Saltelli's design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ldcs_ros.sweep.design import Design, SweepError

CONFIDENCE = 0.95


@dataclass(frozen=True)
class SobolIndices:
    """The fractions of a measure's variance that factors cause.

    Attributes:
        first: Of each factor alone, shape (n_factors,).
        total: Of each factor with all its interactions, shape (n_factors,).
        first_interval, total_interval: Bounds of the 95 % intervals (bootstrap), shape (2, n_factors).
    """

    first: np.ndarray
    total: np.ndarray
    first_interval: np.ndarray
    total_interval: np.ndarray


def sobol_indices(design: Design, measured: np.ndarray) -> SobolIndices:
    """Return the indices of one measure.

    Args:
        design: A design of the sampling 'sobol'.
        measured: The measure at its samples, shape (design.size,).

    Raises:
        SweepError: The design is another one, a value is missing, or all are the same.
    """
    if design.sampling != "sobol":
        raise SweepError(f"Sobol indices need the sampling 'sobol', got '{design.sampling}'")
    if not np.isfinite(measured).all():
        raise SweepError(
            f"{int((~np.isfinite(measured)).sum())} of {len(measured)} samples have no value, "
            "and Sobol indices need all; narrow the bounds"
        )
    if np.ptp(measured) <= 1e-12 * max(1e-12, float(np.abs(measured).max())):
        raise SweepError("the measure is the same at all samples, so that it has no variance to share")
    n, d = design.count, len(design.factors)
    parts = measured.reshape(d + 2, n)
    values = {"f_A": parts[0][None], "f_B": parts[1][None], "f_AB": parts[2:][:, None, :]}
    found = stats.sobol_indices(func=values, n=n, rng=design.seed)
    spread = found.bootstrap(confidence_level=CONFIDENCE)
    first, total = (one.confidence_interval for one in (spread.first_order, spread.total_order))
    return SobolIndices(
        np.ravel(found.first_order),
        np.ravel(found.total_order),
        np.array([np.ravel(first.low), np.ravel(first.high)]),
        np.array([np.ravel(total.low), np.ravel(total.high)]),
    )

"""Designs: the samples of a sweep in a box of factors, and an order in which neighbours follow each other."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import qmc

from ldcs_ros.errors import LdcsError

Sampling = Literal["grid", "latin", "sobol"]
MOST_SAMPLES = 200_000
_CHAINED = 20_000
"""Samples up to which each is followed by its nearest neighbour; more keep their order."""


class SweepError(LdcsError, ValueError):
    """An invalid sweep, or one that cannot be continued."""


@dataclass(frozen=True)
class Factor:
    """A number that a sweep varies.

    Attributes:
        path: Path in the scene such as `effects.payload.mass`, or a command: `pressure.ARM` [Pa], `torque.ARM` or
            `torque.JOINT` [N m], `wrench.FRAME.force.AXIS` [N], `wrench.FRAME.torque.AXIS` [N m].
        low, high: Bounds, in its SI unit.
        levels: Values of a grid; None where samples are drawn.
    """

    path: str
    low: float
    high: float
    levels: int | None = None


@dataclass(frozen=True)
class Design:
    """The samples of a sweep.

    Attributes:
        factors: The factors.
        sampling: 'grid', 'latin' (Latin hypercube) or 'sobol' (Saltelli's design on a Sobol sequence).
        count: Samples of a Latin hypercube; base samples n of 'sobol', a power of 2, which makes n (d + 2) samples.
            Of no meaning for a grid.
        seed: Seed of the draws.

    Raises:
        SweepError: There are no samples, too many of them, or factors that do not fit the sampling.
    """

    factors: tuple[Factor, ...]
    sampling: Sampling = "grid"
    count: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        paths = [factor.path for factor in self.factors]
        if not paths or len(set(paths)) != len(paths):
            raise SweepError(f"got the factors {paths}, expected one or more different ones")
        for factor in self.factors:
            if not (np.isfinite([factor.low, factor.high]).all() and factor.low <= factor.high):
                raise SweepError(f"got {factor.low}..{factor.high}, expected LOW..HIGH @ {factor.path}")
            if (factor.levels is None) == (self.sampling == "grid"):
                given = "no number of levels" if factor.levels is None else f"{factor.levels} levels"
                hint = (
                    "LOW..HIGH:LEVELS"
                    if self.sampling == "grid"
                    else f"LOW..HIGH, as {self.sampling} draws samples"
                )
                raise SweepError(f"got {given}, expected {hint} @ {factor.path}")
            if factor.levels is not None and factor.levels < 1:
                raise SweepError(f"got {factor.levels} levels, expected 1 or more @ {factor.path}")
        if self.sampling == "sobol" and (self.count < 2 or self.count & (self.count - 1)):
            raise SweepError(
                f"got {self.count} samples, expected a power of 2 for a Sobol sequence @ samples"
            )
        if not 1 <= self.size <= MOST_SAMPLES:
            raise SweepError(f"the design has {self.size} samples, expected 1 ... {MOST_SAMPLES}")

    @property
    def size(self) -> int:
        """Number of samples."""
        if self.sampling == "grid":
            return int(np.prod([float(factor.levels or 0) for factor in self.factors]))
        return self.count * (len(self.factors) + 2) if self.sampling == "sobol" else self.count

    def samples(self) -> np.ndarray:
        """Return the samples, shape (size, n_factors).

        Those of 'sobol' are A, B and A with one column of B for each factor (Saltelli et al. 2010), n rows each.
        """
        low = np.array([factor.low for factor in self.factors])
        high = np.array([factor.high for factor in self.factors])
        if self.sampling == "grid":
            axes = [np.linspace(one.low, one.high, one.levels or 1) for one in self.factors]
            return np.array(list(itertools.product(*axes)))
        d = len(self.factors)
        if self.sampling == "latin":
            return low + (high - low) * qmc.LatinHypercube(d, rng=self.seed).random(self.count)
        # As in SciPy, A and B are the halves of one sequence of twice the dimension.
        drawn = qmc.Sobol(2 * d, rng=self.seed).random(self.count)
        a, b = drawn[:, :d], drawn[:, d:]
        mixed = [np.column_stack([b[:, k] if k == i else a[:, k] for k in range(d)]) for i in range(d)]
        return low + (high - low) * np.concatenate([a, b, *mixed])


def neighbour_order(samples: np.ndarray) -> np.ndarray:
    """Return an order of samples, shape (n,): from the first one on, the nearest that is left follows.

    Distances are measured in fractions of the ranges. A rest state near the one before is found sooner.
    """
    n = len(samples)
    if n > _CHAINED:
        return np.arange(n)
    span = np.ptp(samples, axis=0)
    scaled = samples / np.where(span > 0.0, span, 1.0)
    left = np.arange(n)
    order = np.empty(n, dtype=int)
    present = 0
    for k in range(n):
        order[k] = left[present]
        here = scaled[left[present]]
        left = np.delete(left, present)
        if len(left):
            present = int(np.argmin(((scaled[left] - here) ** 2).sum(axis=1)))
    return order


def parse_factor(text: str) -> Factor:
    """Return the factor of `PATH=LOW..HIGH` or `PATH=LOW..HIGH:LEVELS`.

    Raises:
        SweepError: The text has another form.
    """
    path, _, bounds = text.partition("=")
    span, _, levels = bounds.partition(":")
    low, _, high = span.partition("..")
    try:
        return Factor(path.strip(), float(low), float(high), int(levels) if levels else None)
    except ValueError:
        raise SweepError(
            f"got '{text}', expected PATH=LOW..HIGH:LEVELS such as effects.payload.mass=0..0.08:9 @ --over"
        ) from None


def columns_of(factors: Sequence[Factor]) -> tuple[str, ...]:
    """Return the names of the factors."""
    return tuple(factor.path for factor in factors)

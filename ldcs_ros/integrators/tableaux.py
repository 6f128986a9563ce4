"""Coefficients of the ESDIRK pairs, as data: explicit first stage, one diagonal entry, stiffly accurate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Tableau:
    """A stiffly accurate ESDIRK method with an embedded error estimate.

    Attributes:
        a: Stage coefficients, shape (s, s); the last row is the solution.
        embedded: Weights of the embedded solution, shape (s,).
        order: Order of the solution.
        embedded_order: Order of the embedded solution.
        source: Where the coefficients are printed.
    """

    a: np.ndarray
    embedded: np.ndarray
    order: int
    embedded_order: int
    source: str

    @cached_property
    def c(self) -> np.ndarray:
        """Times of the stages in units of the step, shape (s,)."""
        return self.a.sum(axis=1)

    @property
    def diagonal(self) -> float:
        """The common diagonal coefficient gamma."""
        return float(self.a[-1, -1])

    @property
    def error_order(self) -> int:
        """Power of h in the estimate of one step's error."""
        return min(self.order, self.embedded_order) + 1

    @cached_property
    def error_weights(self) -> np.ndarray:
        """Weights of the difference between the solution and the embedded one, shape (s,)."""
        return self.a[-1] - self.embedded


def _trbdf2() -> Tableau:
    gamma = 2.0 - np.sqrt(2.0)
    d, w = gamma / 2.0, np.sqrt(2.0) / 4.0
    a = np.array([[0.0, 0.0, 0.0], [d, d, 0.0], [w, w, d]])
    embedded = np.array([(1.0 - w) / 3.0, (3.0 * w + 1.0) / 3.0, d / 3.0])
    return Tableau(a, embedded, 2, 3, "Hosea and Shampine (1996), Analysis and implementation of TR-BDF2")


def _esdirk43() -> Tableau:
    a = np.zeros((6, 6))
    a[1, :2] = 1 / 4, 1 / 4
    a[2, :3] = 8611 / 62500, -1743 / 31250, 1 / 4
    a[3, :4] = 5012029 / 34652500, -654441 / 2922500, 174375 / 388108, 1 / 4
    a[4, :5] = (
        15267082809 / 155376265600,
        -71443401 / 120774400,
        730878875 / 902184768,
        2285395 / 8070912,
        1 / 4,
    )
    a[5] = 82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4
    embedded = np.array(
        [
            4586570599 / 29645900160,
            0.0,
            178811875 / 945068544,
            814220225 / 1159782912,
            -3700637 / 11593932,
            61727 / 225920,
        ]
    )
    return Tableau(a, embedded, 4, 3, "Kennedy and Carpenter (2003), ARK4(3)6L[2]SA, implicit part")


TRBDF2 = _trbdf2()
ESDIRK43 = _esdirk43()

"""`DriveCurve`: drive torques as a smooth function of time, with given means over the intervals between knots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# Derivatives at a knot are those of the polynomial through the integral at so many knots.
STENCIL = 7
# A polynomial of degree 7 has value, slope and two more derivatives at both ends of an interval.
_DEGREE = 7
_POWERS = np.arange(_DEGREE + 1)
# Derivatives 0 to 3 of s^4 ... s^7 at s = 1, by row.
_AT_END = np.array([[1, 1, 1, 1], [4, 5, 6, 7], [12, 20, 30, 42], [24, 60, 120, 210]], dtype=float)
_FROM_END = np.linalg.inv(_AT_END)


@dataclass(frozen=True, eq=False)
class DriveCurve:
    """Drive torques that are continuous with their first two derivatives.

    Attributes:
        knots: Times of the knots [s], shape (n + 1,), rising; the curve ends with them.
        coefficients: Of the powers of (t - knots[i]) / (knots[i + 1] - knots[i]) in interval i, shape (n, 7,
            n_columns) [N m].
        column: Column of each joint, shape (n_arms, n_links).
    """

    knots: np.ndarray
    coefficients: np.ndarray
    column: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the drive torque of each joint [N m] at times [s], shape (n_times, n_arms, n_links)."""
        times = np.asarray(times)
        k = np.clip(np.searchsorted(self.knots, times, side="right") - 1, 0, len(self.coefficients) - 1)
        return self.values(k, (times - self.knots[k]) * self._inverse_lengths[k])[:, self.column]

    def values(self, interval: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the columns [N m] at fractions s of intervals, shape (n, n_columns)."""
        coefficients, s = self.coefficients[interval], np.clip(s, 0.0, 1.0)[:, None]
        total: np.ndarray = coefficients[:, -1]
        for power in range(_DEGREE - 2, -1, -1):
            total = total * s + coefficients[:, power]
        return total

    @cached_property
    def _inverse_lengths(self) -> np.ndarray:
        return 1.0 / np.diff(self.knots)


def constant_curve(torque: np.ndarray) -> DriveCurve:
    """Return the curve of a torque of each joint that stays [N m], shape (n_arms, n_links)."""
    coefficients = np.zeros((1, _DEGREE, torque.size))
    coefficients[0, 0] = torque.ravel()
    return DriveCurve(np.array([0.0, 1.0]), coefficients, np.arange(torque.size).reshape(torque.shape))


class CurveFit:
    """Smooth curves with given integrals over the intervals between knots.

    A curve is the derivative of a piecewise polynomial through the integral at the knots. Its first three derivatives
    at a knot are those of the polynomial through STENCIL knots around it. A curve is thus local: a command
    changes it for three intervals before and after its own.

    Args:
        knots: Times [s], shape (n + 1,), rising, n >= STENCIL - 1.
    """

    def __init__(self, knots: np.ndarray) -> None:
        n = len(knots) - 1
        self.lengths = np.diff(knots)
        first = np.clip(np.arange(n + 1) - STENCIL // 2, 0, n + 1 - STENCIL)
        self._window = first[:, None] + np.arange(STENCIL)
        self._weights = _derivative_weights(knots[self._window] - knots[:, None])

    def integral(self, parts: np.ndarray) -> np.ndarray:
        """Return coefficients of the integral since an interval's start, of the integrals over all intervals.

        Args:
            parts: Integral over each interval [N m s], shape (n, n_columns).

        Returns:
            Coefficients of the powers 0 to 7 of s, shape (n, 8, n_columns) [N m s].
        """
        total = np.concatenate([np.zeros((1, parts.shape[1])), np.cumsum(parts, axis=0)])
        around = total[self._window] - total[:, None]
        derivatives = self._weights @ around
        h = self.lengths[:, None]
        start = [derivatives[:-1, k] * h ** (k + 1) for k in range(3)]
        end = [derivatives[1:, k] * h ** (k + 1) for k in range(3)]
        result = np.zeros((len(parts), _DEGREE + 1, parts.shape[1]))
        result[:, 1], result[:, 2], result[:, 3] = start[0], start[1] / 2.0, start[2] / 6.0
        rest = np.stack(
            [
                parts - result[:, 1] - result[:, 2] - result[:, 3],
                end[0] - start[0] - start[1] - 0.5 * start[2],
                end[1] - start[1] - start[2],
                end[2] - start[2],
            ],
            axis=1,
        )
        result[:, 4:] = _FROM_END @ rest
        return result

    def derivative(self, integral: np.ndarray) -> np.ndarray:
        """Return the coefficients of the curve [N m], shape (n, 7, n_columns), of those of its integral."""
        return _POWERS[1:, None] * integral[:, 1:] / self.lengths[:, None, None]

    def first_moment(self, integral: np.ndarray) -> np.ndarray:
        """Return the integral over each interval of the curve's integral since its start [N m s^2].

        Shapes: `integral` (n, 8, n_columns), the result (n, n_columns).
        """
        return self.lengths[:, None] * np.sum(integral / (_POWERS[:, None] + 1.0), axis=1)


def _derivative_weights(places: np.ndarray) -> np.ndarray:
    """Return weights of the values at places, shape (n, m), for derivatives 1 to 3 at 0, shape (n, 3, m).

    Fornberg's recursion (Mathematics of Computation 51, 1988, page 699), for all rows at once.
    """
    n, m = places.shape
    c = np.zeros((m, 4, n))
    c[0, 0] = 1.0
    product = np.ones(n)
    for i in range(1, m):
        before, product = product, np.ones(n)
        for j in range(i):
            gap = places[:, i] - places[:, j]
            product = product * gap
            if j == i - 1:
                for k in range(3, 0, -1):
                    c[i, k] = before * (k * c[j, k - 1] - places[:, j] * c[j, k]) / product
                c[i, 0] = -before * places[:, j] * c[j, 0] / product
            for k in range(3, 0, -1):
                c[j, k] = (places[:, i] * c[j, k] - k * c[j, k - 1]) / gap
            c[j, 0] = places[:, i] * c[j, 0] / gap
    return np.ascontiguousarray(c[:, 1:].transpose(2, 1, 0))

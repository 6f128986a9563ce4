"""The quality of a fit: confidence intervals, misfit of the structure, score on held-out bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from ldcs_ros.identify.experiments import Experiment
from ldcs_ros.identify.fitting import Minimum
from ldcs_ros.identify.parameters import FitParameter

# A sound structure exceeds these once in millions of fits: five standard deviations of either statistic.
ALARM = 5.0
CUT_OFF = 37.0  # standard deviations; beyond, a probability is too small for a float
NINETY_FIVE = 1.959963984540054  # standard deviations of a normal distribution
UNDETERMINED = 0.25  # of the bounds: the data do not determine a parameter with a wider standard deviation


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted number.

    Attributes:
        parameter: The parameter.
        value: Best value, SI.
        low, high: 95 % confidence interval; from the Jacobian, scaled up if the structure does not fit.
        at_bound: The value lies on a bound; its interval is then meaningless.
        undetermined: The data hardly determine it.
    """

    parameter: FitParameter
    value: float
    low: float
    high: float
    at_bound: bool
    undetermined: bool


@dataclass(frozen=True)
class Score:
    """The distance of the model from the measurements of some bags, in standard deviations of the noise.

    Attributes:
        name: Name of the bag, or 'all'.
        count: Measured coordinates.
        reduced_chi_square: Mean of the squares; 1 if only noise is left.
        correlation: Correlation of neighbours in time; 0 if only noise is left.
        ljung_box_z: Ljung and Box's test over 0.25 s, as standard deviations of a normal distribution.
        within_three: Fraction of coordinates within three standard deviations; 0.9973 if only noise is left.
        largest: Largest distance of a coordinate [standard deviations].
        largest_mean: Largest mean over 0.25 s, in which noise averages out [standard deviations].
    """

    name: str
    count: int
    reduced_chi_square: float
    correlation: float
    ljung_box_z: float
    within_three: float
    largest: float
    largest_mean: float


@dataclass(frozen=True)
class Misfit:
    """The test for residuals that the model's structure cannot explain.

    Attributes:
        found: True if it does not fit.
        excess: (Reduced chi-square - 1) in its own standard deviations.
        ljung_box_z: Ljung and Box's test for residuals that persist between samples, in standard deviations.
        words: The finding, in words.
    """

    found: bool
    excess: float
    ljung_box_z: float
    words: str


def estimates(
    parameters: Sequence[FitParameter], minimum: Minimum, *, inflation: float
) -> list[ParameterEstimate]:
    """Return value and 95 % interval of each parameter, from the Fisher information J^T J of the residuals.

    Args:
        parameters: The fitted parameters.
        minimum: The minimum.
        inflation: Factor on standard deviations: 1 for a sound structure, else sqrt of the reduced chi-square.
    """
    deviation = inflation * np.sqrt(np.diag(covariance(minimum)))
    found = []
    for p, fraction, wide in zip(parameters, minimum.normalised, deviation, strict=True):
        reach = NINETY_FIVE * float(wide)
        low, high = (p.value(float(np.clip(fraction + sign * reach, -1.0, 2.0))) for sign in (-1.0, 1.0))
        at_bound = bool(fraction < 1e-4 or fraction > 1.0 - 1e-4)
        found.append(
            ParameterEstimate(p, p.value(float(fraction)), low, high, at_bound, bool(wide > UNDETERMINED))
        )
    return found


def covariance(minimum: Minimum) -> np.ndarray:
    """Return the covariance of the normalised values, shape (n, n); an undetermined direction is wide, not infinite."""
    _u, strength, rows = np.linalg.svd(minimum.jacobian, full_matrices=False)
    strength = np.maximum(strength, 1e-6)
    matrix: np.ndarray = (rows.T / strength**2) @ rows
    return matrix


def correlation(minimum: Minimum) -> np.ndarray:
    """Return the correlation matrix of the fitted parameters, shape (n, n)."""
    matrix = covariance(minimum)
    deviation = np.sqrt(np.diag(matrix))
    normed: np.ndarray = matrix / np.outer(deviation, deviation)
    return normed


def score(experiments: Sequence[Experiment], residual: np.ndarray, *, name: str = "all") -> Score:
    """Return the score of residuals that belong to some bags.

    Args:
        experiments: The bags.
        residual: Residuals of all finite measurements, bag after bag, shape (n_residuals,).
        name: Name of the score.
    """
    tracks, means, used = [], [0.0], 0
    lags = 1
    for experiment in experiments:
        measured = np.isfinite(experiment.position)
        whole = np.full(measured.shape, np.nan)
        whole[measured] = residual[used : used + experiment.count]
        used += experiment.count
        track = whole.reshape(len(whole), -1)
        tracks.append(track)
        period = float(np.median(np.diff(experiment.time))) if len(track) > 1 else 1.0
        width = max(1, min(round(0.25 / period), len(track)))
        lags = max(lags, min(width, len(track) // 4))
        sums = np.apply_along_axis(np.convolve, 0, np.nan_to_num(track), np.ones(width) / width, "valid")
        means.append(float(np.abs(sums).max()))
    square = float(np.mean(residual**2))
    correlations, pairs = _correlations(tracks, lags, square)
    return Score(
        name=name,
        count=len(residual),
        reduced_chi_square=square,
        correlation=float(correlations[0]),
        ljung_box_z=_normal(float(np.sum(pairs * correlations**2)), lags),
        within_three=float(np.mean(np.abs(residual) <= 3.0)),
        largest=float(np.abs(residual).max()),
        largest_mean=max(means),
    )


def _correlations(tracks: Sequence[np.ndarray], lags: int, square: float) -> tuple[np.ndarray, np.ndarray]:
    # Correlation at each lag over all coordinates of all bags, and the number of its pairs.
    found, pairs = np.zeros(lags), np.zeros(lags)
    for lag in range(1, lags + 1):
        products = np.concatenate([(track[lag:] * track[:-lag]).ravel() for track in tracks])
        products = products[np.isfinite(products)]
        pairs[lag - 1] = len(products)
        found[lag - 1] = products.mean() / square if len(products) and square > 0.0 else 0.0
    return found, pairs


def _normal(statistic: float, freedom: int) -> float:
    # The chi-square variable as a normal one of the same rarity; underflows are cut off.
    return float(np.clip(norm.isf(chi2.sf(statistic, freedom)), -CUT_OFF, CUT_OFF))


def scores(experiments: Sequence[Experiment], residual: np.ndarray) -> list[Score]:
    """Return the score of each bag; the residuals are those of `score`, shape (n_residuals,)."""
    parts, used = [], 0
    for experiment in experiments:
        parts.append(score([experiment], residual[used : used + experiment.count], name=experiment.name))
        used += experiment.count
    return parts


def misfit(whole: Score, n_parameters: int) -> Misfit:
    """Return whether residuals hold more than noise: too large (chi-square), or persistent (correlation).

    A structure that cannot explain the data leaves persistent residuals, which show long before chi-square does.
    """
    freedom = max(whole.count - n_parameters, 1)
    excess = (whole.reduced_chi_square * whole.count / freedom - 1.0) / np.sqrt(2.0 / freedom)
    reasons = []
    if excess > ALARM:
        reasons.append(
            f"residuals are {np.sqrt(whole.reduced_chi_square):.3g} times the noise "
            f"(chi-square {excess:.0f} standard deviations too large)"
        )
    if whole.ljung_box_z > ALARM:
        reasons.append(f"residuals last (correlation {whole.correlation:.2f} from sample to sample)")
    if not reasons:
        return Misfit(False, float(excess), whole.ljung_box_z, "only noise is left")
    words = (
        f"{' and '.join(reasons)}: with these parameters the scene's structure cannot explain the recording; "
        "look at spring law, effects and points, or fit more numbers"
    )
    return Misfit(True, float(excess), whole.ljung_box_z, words)

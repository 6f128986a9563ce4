"""Bounded least squares on trajectories from several starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from ldcs_ros.identify.experiments import IdentificationError
from ldcs_ros.identify.parameters import FitParameter, values_at
from ldcs_ros.identify.prediction import FIT_ACCURACY
from ldcs_ros.identify.workers import Workers

DIFFERENCE = 1e-4  # of the way between the bounds
FAILED_RESIDUAL = 1e3  # standard deviations, of a scene without an answer: the step is taken back
# Far from the minimum a direction with an error of a percent suffices: starts are screened and followed at the usual
# accuracy. Only the best is polished at the accuracy of the answer, with its old slopes. Their error is a percent, so
# each polishing run reduces the error by a factor of a hundred.
ROUGH_ACCURACY = 1e-5  # m
# Tangents are derivatives of the computed motion itself, without the noise of differences. The answer's error is a
# third of the accuracy and must be well below what noise leaves, 3e-6 m of 0.1 mm over 1000 coordinates.
TANGENT_ACCURACY, TANGENT_FIT_ACCURACY = 1e-4, 1e-6  # m
FOLLOWED = 3  # starts that are followed
SAME = 1e-2  # fraction of the bounds: two minima closer than that are one


@dataclass(frozen=True)
class Minimum:
    """The end of the search from one start.

    Attributes:
        normalised: Place between the bounds, shape (n,).
        residual: Residuals there in standard deviations, shape (n_data,).
        jacobian: d(residual)/d(fraction), shape (n_data, n).
        converged: The search ended by itself.
    """

    normalised: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    converged: bool

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)


def search(
    parameters: Sequence[FitParameter],
    workers: Workers,
    *,
    starts: int = 8,
    seed: int = 0,
    tangents: bool = False,
    progress: Callable[[float, str], None] = lambda fraction, what: None,
) -> list[Minimum]:
    """Return the minima found, best first: start values are screened, the best few are followed.

    Args:
        parameters: Parameters to fit.
        workers: Processes that compute residuals.
        starts: Starts to screen: the scene's own values, and a Latin hypercube between the bounds.
        seed: Seed of the hypercube.
        tangents: Slopes are tangents of the runs; otherwise differences.
        progress: Called with the fraction of the work that is done, and a description of the present step.

    Raises:
        IdentificationError: The scene has no answer at any start.
    """
    places = _starts(parameters, starts, seed)
    accuracy = TANGENT_ACCURACY if tangents else ROUGH_ACCURACY
    progress(0.0, f"screening {len(places)} starts")
    screened = workers.residuals([values_at(parameters, p) for p in places], accuracy=accuracy)
    ranked = sorted(
        (float(r @ r), k) for k, r in enumerate(screened) if r is not None and np.isfinite(r).all()
    )
    if not ranked:
        raise IdentificationError(
            "the scene cannot follow the bags at any start value; check the scene, and narrow the bounds"
        )
    # The scene's own values are a best guess: they are always followed if they have an answer.
    chosen = [k for _, k in ranked[:FOLLOWED]]
    if screened[0] is not None and 0 not in chosen:
        chosen[-1] = 0
    rough: list[Minimum] = []
    for number, k in enumerate(chosen):
        label = f"start {number + 1} of {len(chosen)}"
        fraction = 0.1 + 0.6 * number / len(chosen)
        descent = _Descent(parameters, workers, accuracy, _labelled(progress, fraction, label), tangents)
        known = [minimum.normalised for minimum in rough]
        minimum = descent.run(places[k], tolerance=1e-3, known=known)
        if minimum is not None:
            rough.append(minimum)
    rough.sort(key=lambda minimum: minimum.cost)
    best = None
    if rough and tangents and any(parameter.is_start for parameter in parameters):
        # Of many unknowns, some are hardly determined: polishing needs slopes better than those of the rough run.
        tell = _labelled(progress, 0.7, "following the best")
        closer = _Descent(parameters, workers, ROUGH_ACCURACY, tell, tangents)
        rough[0] = closer.run(rough[0].normalised, tolerance=1e-4) or rough[0]
    if rough:
        finest = TANGENT_FIT_ACCURACY if tangents else FIT_ACCURACY
        descent = _Descent(parameters, workers, finest, _labelled(progress, 0.75, "polishing"))
        best = descent.run(rough[0].normalised, tolerance=1e-8, slopes=rough[0].jacobian)
    progress(1.0, "")
    if best is None:
        raise IdentificationError(
            "the scene has no answer at the end of the search; check it, and narrow the bounds"
        )
    return [best, *rough[1:]]


def distinct(minima: Sequence[Minimum], *, tolerance: float = SAME) -> list[Minimum]:
    """Return minima that are at different places, best first."""
    kept: list[Minimum] = []
    for minimum in minima:
        if all(np.abs(minimum.normalised - other.normalised).max() > tolerance for other in kept):
            kept.append(minimum)
    return kept


class _KnownMinimum(Exception):
    """A descent has come to a minimum that is known already."""


class _Descent:
    """One descent; keeps the last residual, from which the differences are taken."""

    def __init__(
        self,
        parameters: Sequence[FitParameter],
        workers: Workers,
        accuracy: float,
        progress: Callable[[str], None],
        tangents: bool = False,
    ) -> None:
        self._parameters, self._workers = parameters, workers
        self._accuracy, self._progress, self._tangents = accuracy, progress, tangents
        self._jacobian: np.ndarray | None = None
        self._at = np.full(len(parameters), np.nan)
        self._residual = np.zeros(0)
        self._known: Sequence[np.ndarray] = ()
        self._slopes: np.ndarray | None = None

    def run(
        self,
        start: np.ndarray,
        *,
        tolerance: float,
        known: Sequence[np.ndarray] = (),
        slopes: np.ndarray | None = None,
    ) -> Minimum | None:
        """Return the minimum below a start; None if there is no answer there, or the minimum is known.

        Args:
            start: First values, normalised, shape (n,).
            tolerance: Relative change of the cost at which the search ends.
            known: Minima that are known, shape (n,) each.
            slopes: d(residual)/d(fraction) to use all the way; None computes it when needed.
        """
        start = np.clip(start, 1e-6, 1.0 - 1e-6)
        self._known, self._slopes = known, slopes
        first = self._answer(start)
        if first is None:
            return None
        self._residual, self._at = first, start
        try:
            found = least_squares(
                self._residual_at,
                start,
                jac=self._jacobian_at,
                bounds=(0.0, 1.0),
                xtol=10.0 * tolerance,
                ftol=tolerance,
                gtol=1e-10,
                max_nfev=30,
            )
        except _KnownMinimum:
            return None
        return Minimum(found.x, found.fun, found.jac, found.status > 0)

    def _residual_at(self, normalised: np.ndarray) -> np.ndarray:
        if not np.array_equal(normalised, self._at):
            answer = self._answer(normalised)
            self._residual = np.full(len(self._residual), FAILED_RESIDUAL) if answer is None else answer
            self._at = normalised.copy()
            square = float(np.mean(self._residual**2))
            self._progress(f"reduced chi-square {square:.4g}")
            if any(np.abs(normalised - place).max() < SAME for place in self._known):
                raise _KnownMinimum
        return self._residual

    def _jacobian_at(self, normalised: np.ndarray) -> np.ndarray:
        if self._slopes is not None:
            return self._slopes
        here = self._residual_at(normalised)
        if self._tangents:
            assert self._jacobian is not None
            return self._jacobian
        # Towards the middle, so that no bound is passed.
        steps = np.where(normalised > 0.5, -DIFFERENCE, DIFFERENCE)
        moved = self._compute(list(normalised + np.diag(steps)))
        columns = [
            np.zeros_like(here) if answer is None else (answer - here) / step
            for answer, step in zip(moved, steps, strict=True)
        ]
        return np.stack(columns, axis=1)

    def _answer(self, place: np.ndarray) -> np.ndarray | None:
        if not self._tangents or self._slopes is not None:
            return self._compute([place])[0]
        # One run gives both; the few steps that are taken back waste the slopes.
        found = self._workers.linearised(values_at(self._parameters, place), accuracy=self._accuracy)
        if found is None:
            self._jacobian = np.zeros((len(self._residual), len(place)))
            return None
        residual, slopes = found
        scale = [p.slope(float(s)) for p, s in zip(self._parameters, place, strict=True)]
        self._jacobian = slopes * np.array(scale)
        return residual

    def _compute(self, places: Sequence[np.ndarray]) -> list[np.ndarray | None]:
        values = [values_at(self._parameters, place) for place in places]
        return self._workers.residuals(values, accuracy=self._accuracy)


def _labelled(progress: Callable[[float, str], None], fraction: float, label: str) -> Callable[[str], None]:
    return lambda cost: progress(fraction, f"{label}, {cost}")


def _starts(parameters: Sequence[FitParameter], count: int, seed: int) -> np.ndarray:
    own = np.array([[p.fraction(p.start) for p in parameters]])
    if count <= 1:
        return own
    others = np.repeat(own, count - 1, axis=0)
    # Starts of bags are linear, or nearly so.
    drawn = [k for k, p in enumerate(parameters) if not p.is_start]
    others[:, drawn] = qmc.LatinHypercube(len(drawn), seed=seed).random(count - 1)
    return np.concatenate([own, others])

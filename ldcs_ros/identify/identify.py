"""The whole identification: from bags and names of parameters to a judged fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.identify.diagnostics import (
    Misfit,
    ParameterEstimate,
    Score,
    correlation,
    estimates,
    misfit,
    score,
    scores,
)
from ldcs_ros.identify.experiments import Experiment, IdentificationError
from ldcs_ros.identify.fitting import Minimum, distinct, search
from ldcs_ros.identify.parameters import FitParameter, check_parameters, values_at
from ldcs_ros.identify.workers import Workers
from ldcs_ros.scene import Scene
from ldcs_ros.schema.paths import with_values


@dataclass(frozen=True)
class Identification:
    """The result of an identification.

    Attributes:
        content: The scene with the fitted values, as plain values.
        estimates: Each parameter with its interval.
        correlation: Correlation of the parameters, shape (n, n).
        misfit: Whether the structure fits.
        whole: Score of all fitted bags together.
        fitted: Score of each fitted bag.
        held_out: Score of each bag that was not fitted.
        minima: Different minima that were found, best first.
        evaluations: Parameter sets that were computed, each for all bags.
    """

    content: dict[str, Any]
    estimates: list[ParameterEstimate]
    correlation: np.ndarray
    misfit: Misfit
    whole: Score
    fitted: list[Score]
    held_out: list[Score]
    minima: list[Minimum]
    evaluations: int


def identify(
    scene: Scene,
    experiments: Sequence[Experiment],
    parameters: Sequence[FitParameter],
    *,
    held_out: Sequence[Experiment] = (),
    starts: int = 8,
    seed: int = 0,
    processes: int | None = None,
    progress: Callable[[float, str], None] = lambda fraction, what: None,
) -> Identification:
    """Fit parameters of a scene to experiments and judge the fit.

    Args:
        scene: The scene; parameters start at its values.
        experiments: Bags to fit.
        parameters: Parameters to fit.
        held_out: Bags to predict with the result, unseen by the fit.
        starts: Start values to screen.
        seed: Seed of the start values.
        processes: Worker processes; None for one a core, 1 for none.
        progress: Called with the fraction of the work that is done, and a description of the present step.

    Raises:
        IdentificationError: The data cannot determine the parameters in principle, or nothing can be computed.
    """
    content = scene.content
    count = sum(experiment.count for experiment in experiments)
    if not parameters or count <= len(parameters):
        raise IdentificationError(f"{count} measured numbers cannot determine {len(parameters)} parameters")
    check_parameters(parameters, content)
    with Workers(content, experiments, processes=processes) as workers:
        minima = search(parameters, workers, starts=starts, seed=seed, progress=progress)
        evaluations = workers.count
    best = minima[0]
    whole = score(experiments, best.residual)
    finding = misfit(whole, len(parameters))
    inflation = float(np.sqrt(max(1.0, whole.reduced_chi_square))) if finding.found else 1.0
    values = values_at(parameters, best.normalised)
    unseen: list[Score] = []
    if held_out:
        with Workers(content, held_out, processes=1) as workers:
            answer = workers.residuals([values])[0]
        if answer is None:
            raise IdentificationError("the fitted scene cannot follow the held-out bags; fit more parameters")
        unseen = scores(held_out, answer)
    return Identification(
        content=with_values(content, values),
        estimates=estimates(parameters, best, inflation=inflation),
        correlation=correlation(best),
        misfit=finding,
        whole=whole,
        fitted=scores(experiments, best.residual),
        held_out=unseen,
        minima=distinct(minima),
        evaluations=evaluations,
    )

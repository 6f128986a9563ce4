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
from ldcs_ros.identify.parameters import (
    FitParameter,
    check_parameters,
    scene_values,
    start_parameters,
    values_at,
)
from ldcs_ros.identify.prediction import no_tangents_reason
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
        slopes: How the slopes were computed, in words.
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
    slopes: str = "tangents"


def identify(
    scene: Scene,
    experiments: Sequence[Experiment],
    parameters: Sequence[FitParameter],
    *,
    held_out: Sequence[Experiment] = (),
    starts: int = 8,
    seed: int = 0,
    processes: int | None = None,
    tangents: bool = True,
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
        tangents: Slopes are tangents of the runs where these exist; otherwise differences.
        progress: Called with the fraction of the work that is done, and a description of the present step.

    Raises:
        IdentificationError: The data cannot determine the parameters in principle, or nothing can be computed.
    """
    content = scene.content
    count = sum(experiment.count for experiment in experiments)
    starts_of_bags = [
        one
        for number, experiment in enumerate(experiments)
        if experiment.start is not None
        for one in start_parameters(number, experiment.start.ranges)
    ]
    unknowns = [*parameters, *starts_of_bags]
    if not parameters or count <= len(unknowns):
        raise IdentificationError(f"{count} measured numbers cannot determine {len(unknowns)} parameters")
    check_parameters(parameters, content)
    reason = no_tangents_reason(scene, unknowns, experiments) if tangents else "differences were asked for"
    with Workers(content, experiments, processes=processes) as workers:
        minima = search(
            unknowns, workers, starts=starts, seed=seed, tangents=reason is None, progress=progress
        )
        evaluations = workers.count
    best = minima[0]
    whole = score(experiments, best.residual)
    finding = misfit(whole, len(unknowns))
    inflation = float(np.sqrt(max(1.0, whole.reduced_chi_square))) if finding.found else 1.0
    values = scene_values(values_at(unknowns, best.normalised))
    unseen: list[Score] = []
    if held_out:
        with Workers(content, held_out, processes=1) as workers:
            answer = workers.residuals([values])[0]
        if answer is None:
            raise IdentificationError("the fitted scene cannot follow the held-out bags; fit more parameters")
        unseen = scores(held_out, answer)
    return Identification(
        content=with_values(content, values),
        estimates=estimates(unknowns, best, inflation=inflation)[: len(parameters)],
        correlation=correlation(best)[: len(parameters), : len(parameters)],
        misfit=finding,
        whole=whole,
        fitted=scores(experiments, best.residual),
        held_out=unseen,
        minima=distinct(minima),
        evaluations=evaluations,
        slopes="tangents" if reason is None else f"differences: {reason}",
    )

"""Identifiability from Table I: confidence, undetermined directions, profile, sensitivity, rival structures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ldcs_ros.schema.paths import with_values
from ldcs_ros.validate.calibration import Fit, fit, fitted_content, sigma, slopes, target
from ldcs_ros.validate.parameters import OPEN, PARAMETERS, SENSOR_HEIGHT, Parameter

Progress = Callable[[str], None]
TORQUE = "inputs[0].torque"


@dataclass(frozen=True)
class Confidence:
    """The confidence of the fitted numbers, from the Fisher information J^T S^-2 J.

    Attributes:
        deviation: Standard deviation of each fitted parameter, SI, by short name. If the model misses the data by
            more than their own scatter, the Birge ratio scales it up.
        correlation: Correlation matrix in the order of `PARAMETERS`.
        misfit: Sum of squared residuals over their standard deviations.
        freedom: Data less fitted parameters.
    """

    deviation: dict[str, float]
    correlation: np.ndarray
    misfit: float
    freedom: int


def confidence(content: dict[str, Any], seen: np.ndarray) -> Confidence:
    """Return the confidence of the fitted parameters at a scene whose observations are `seen` [mm], shape (5,)."""
    jacobian = slopes(content, PARAMETERS) / sigma()[:, None]
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    misfit, freedom = float(np.sum(((seen - target()) / sigma()) ** 2)), len(seen) - len(PARAMETERS)
    deviation = np.sqrt(np.diag(covariance))
    ratio = np.sqrt(max(1.0, misfit / freedom))
    return Confidence(
        {p.short: float(ratio * d) for p, d in zip(PARAMETERS, deviation, strict=True)},
        covariance / np.outer(deviation, deviation),
        misfit,
        freedom,
    )


@dataclass(frozen=True)
class Direction:
    """A combination of open parameters and the strength with which the data determine it.

    Attributes:
        strength: Change of the data in standard deviations for one plausible range along it; below 1 the data do not
            determine it.
        weights: Weight of each parameter, in plausible ranges, by short name; unit length.
    """

    strength: float
    weights: dict[str, float]


def directions(content: dict[str, Any]) -> list[Direction]:
    """Return all directions of fitted and open parameters, strongest first (singular values of the scaled J)."""
    parameters = (*PARAMETERS, *OPEN)
    scaled = slopes(content, parameters) * np.array([p.spread for p in parameters]) / sigma()[:, None]
    _, strengths, rows = np.linalg.svd(scaled, full_matrices=True)
    strengths = np.concatenate([strengths, np.zeros(len(rows) - len(strengths))])
    return [
        Direction(float(s), {p.short: float(w) for p, w in zip(parameters, row, strict=True)})
        for s, row in zip(strengths, rows, strict=True)
    ]


@dataclass(frozen=True)
class Sensitivity:
    """The change of the data when one parameter changes by its plausible range.

    Attributes:
        parameter: The parameter.
        alone: Change of (P0 x, P0 z, P1 x, P1 z, r) with all else kept [mm], shape (5,).
        held: The same with the torque adjusted so that the radius stays, as in the experiment [mm], shape (5,).
    """

    parameter: Parameter
    alone: np.ndarray
    held: np.ndarray


def sensitivities(content: dict[str, Any]) -> list[Sensitivity]:
    """Return the sensitivities to every fitted and open parameter, largest at a held radius first."""
    parameters = (*PARAMETERS, *OPEN)
    changes = slopes(content, parameters) * np.array([p.spread for p in parameters])
    torque = changes[:, [p.path for p in parameters].index(TORQUE)]
    found = [
        Sensitivity(p, change, change - torque * change[-1] / torque[-1])
        for p, change in zip(parameters, changes.T, strict=True)
    ]
    return sorted(found, key=lambda s: float(np.abs(s.held[:4]).max()), reverse=True)


def profile(content: dict[str, Any], path: str, values: list[float]) -> Iterator[tuple[float, Fit]]:
    """Yield the best fit of the other parameters with one held at each of some values."""
    others = tuple(p for p in PARAMETERS if p.path != path)
    for value in values:
        yield value, fit(fitted_content(content, {path: value}), others)


@dataclass(frozen=True)
class Structure:
    """A discrete reading of the test that was tried with the same fitted numbers.

    Attributes:
        title: Difference to the calibrated scene.
        changes: Values by path.
        parameters: Fitted parameters.
    """

    title: str
    changes: dict[str, Any]
    parameters: tuple[Parameter, ...] = PARAMETERS


def _structures() -> tuple[Structure, ...]:
    width, law = "effects.arms.width", "effects.springs.law"
    stiffness, torque, height = PARAMETERS
    sensor = next(p for p in OPEN if p.path == SENSOR_HEIGHT)
    flat = {height.path: 0.0}
    # The bound of the torque is that of the shipped structure; others may ask for more.
    free = (stiffness, replace(torque, high=0.5))
    return (
        Structure("as shipped", {}),
        Structure("arms on the border lines only", {width: 0}, (*free, height)),
        Structure("arms one cell wide", {width: 1}),
        Structure("arms three cells wide", {width: 3}),
        Structure("k = 80 N/m as printed", {"effects.springs.stiffness": 80.0}),
        Structure(
            "corotational springs, k = 80 N/m", {law: "corotational", "effects.springs.stiffness": 80.0}
        ),
        Structure("payload at the mid-plane", {"effects.payload.at": ["mid", 8, 4]}),
        Structure("payload at the bottom", {"effects.payload.at": ["bottom", 8, 4]}),
        Structure("crosspieces on the bisector", {"effects.arms.crosspiece": "bisector"}),
        Structure("half a joint at the base", {"effects.arms.base_joint_share": 0.5}, (*free, height)),
        Structure("10 mm of stiff base", {"effects.arms.rigid_base": 0.010}),
        Structure("backbone on the mid-plane", flat, free),
        Structure("backbone on the mid-plane, sensors at a fitted height", flat, (*free, sensor)),
    )


STRUCTURES = _structures()


def compare_structures(content: dict[str, Any], progress: Progress) -> Iterator[tuple[Structure, Fit]]:
    """Yield each structure of `STRUCTURES` with its best fit; `progress` is called with the title of each."""
    for structure in STRUCTURES:
        progress(structure.title)
        yield structure, fit(with_values(content, structure.changes), structure.parameters)

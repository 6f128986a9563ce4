"""The fit of the scene `paper_calibrated`: three numbers to the four displacements and the radius of Table I.

Physical, discrete structures were compared first (docs/validation.md has the table); the remaining numbers are fitted
here. One model gives P0 and P1, and all displacements have the same weight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ldcs_ros.errors import LdcsError
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.paths import with_values
from ldcs_ros.validate import paper
from ldcs_ros.validate.measure import MM, Rest, at_rest
from ldcs_ros.validate.parameters import CALIBRATED, PARAMETERS, SENSOR_HEIGHT, Parameter, present

# Standard deviations of the data: the printed digits and the tracker allow 0.1 mm; "r = 0.115 m" is printed to 1 mm.
DISPLACEMENT_SIGMA = 0.1  # mm
RADIUS_SIGMA = 0.5  # mm
# Central differences of equilibria balanced to 1e-12 m: a step of 1e-4 of the scale is exact to 1e-6.
DIFFERENCE = 1e-4
OBSERVATIONS = ("P0 x", "P0 z", "P1 x", "P1 z", "r")


@dataclass(frozen=True)
class Fit:
    """The result of the fit.

    Attributes:
        values: Fitted values by path, SI.
        content: The scene with them.
        seen: Its `observe` [mm], shape (5,).
        misfit: Sum of squares of (seen - target) / sigma over all five.
        evaluations: Equilibria computed.
    """

    values: dict[str, float]
    content: dict[str, Any]
    seen: np.ndarray
    misfit: float
    evaluations: int


def calibrated_content() -> dict[str, Any]:
    """Return the shipped calibrated scene as plain values."""
    return load_scene(CALIBRATED).content


def fitted_content(content: dict[str, Any], values: dict[str, float]) -> dict[str, Any]:
    """Return a copy of a scene with fitted values; the height of the sensor is no part of a scene."""
    return with_values(content, {path: value for path, value in values.items() if path != SENSOR_HEIGHT})


def observe(content: dict[str, Any], values: dict[str, float] | None = None) -> np.ndarray:
    """Return ux and uz of P0 and P1 and the radius of a scene at its equilibrium [mm], shape (5,).

    Args:
        content: The scene.
        values: Values to put into it first, by path, also of `SENSOR_HEIGHT`.
    """
    rest = at_rest(fitted_content(content, values or {}))
    height = (values or {}).get(SENSOR_HEIGHT, 0.0)
    p0, p1 = (rest.displacement[name] + _off_the_mid_plane(rest, name, height) for name in paper.POINTS)
    return np.array([p0[0], p0[2], p1[0], p1[2], 1e3 * rest.radius])


def _off_the_mid_plane(rest: Rest, name: str, height: float) -> np.ndarray:
    # Displacement of a sensor at a height of the sheet beyond that on the mid-plane [mm], shape (3,): the line from
    # the bottom to the top node stays straight.
    lattice = rest.simulation.lattice
    point = rest.simulation.points[name]
    through = point.nodes.reshape(2, -1)[:, 0]
    now, flat = (np.diff(place[through], axis=0)[0] for place in (rest.position, lattice.reference_position))
    further: np.ndarray = MM * height / lattice.size[2] * (now - flat)
    return further


def target() -> np.ndarray:
    """Return the experiment's values of `observe` [mm], shape (5,)."""
    p0, p1 = paper.EXPERIMENT["P0"], paper.EXPERIMENT["P1"]
    return np.array([p0[0], p0[2], p1[0], p1[2], 1e3 * paper.RADIUS])


def sigma() -> np.ndarray:
    """Return the standard deviations of `target` [mm], shape (5,)."""
    return np.array([DISPLACEMENT_SIGMA] * 4 + [RADIUS_SIGMA])


def fit(
    content: dict[str, Any],
    parameters: Sequence[Parameter] = PARAMETERS,
    *,
    start: dict[str, float] | None = None,
    without: str = "",
) -> Fit:
    """Fit parameters of a scene to the experiment: bounded least squares on equilibria.

    Args:
        content: The scene; parameters start at its values.
        parameters: Parameters to fit, between their bounds.
        start: Other starting values by path.
        without: One of `OBSERVATIONS` that the fit leaves out; '' for none.
    """
    used = np.array([name != without for name in OBSERVATIONS])
    begin = [(start or {}).get(p.path, present(content, p)) for p in parameters]
    low, high = [p.low for p in parameters], [p.high for p in parameters]
    scale = np.array([p.spread for p in parameters])
    count = 0

    def residual(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        try:
            seen = observe(content, {p.path: v for p, v in zip(parameters, x, strict=True)})
        except LdcsError:
            return np.full(np.count_nonzero(used), 1e3)  # no such equilibrium: the step is taken back
        missed: np.ndarray = ((seen - target()) / sigma())[used]
        return missed

    found = least_squares(
        residual,
        np.clip(begin, low, high),
        bounds=(low, high),
        x_scale=scale,
        diff_step=DIFFERENCE,
        max_nfev=40,
    )
    values = {p.path: float(v) for p, v in zip(parameters, found.x, strict=True)}
    seen = observe(content, values)
    return Fit(
        values,
        fitted_content(content, values),
        seen,
        float(np.sum(((seen - target()) / sigma()) ** 2)),
        count,
    )


def held_out_errors(content: dict[str, Any], progress: Callable[[str], None]) -> dict[str, float]:
    """Return the error of each of `OBSERVATIONS` [mm] as predicted by a fit to the other four, by name.

    Args:
        content: The scene; fits start at its values.
        progress: Called with the name of each before its fit.
    """
    errors = {}
    for index, name in enumerate(OBSERVATIONS):
        progress(name)
        errors[name] = float((fit(content, without=name).seen - target())[index])
    return errors


def slopes(content: dict[str, Any], parameters: Sequence[Parameter]) -> np.ndarray:
    """Return d(observe)/d(parameter) by central differences (one-sided at a bound), shape (5, n) [mm per SI unit]."""
    columns = []
    for parameter in parameters:
        here = present(content, parameter)
        step = DIFFERENCE * parameter.spread
        above, below = min(here + step, parameter.high), max(here - step, parameter.low)
        upper, lower = (observe(content, {parameter.path: value}) for value in (above, below))
        columns.append((upper - lower) / (above - below))
    return np.stack(columns, axis=1)

"""The parameters to identify: their paths in the scene, their bounds and their scale."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import SceneError
from ldcs_ros.identify.experiments import IdentificationError
from ldcs_ros.scene import load_scene
from ldcs_ros.scene.load import complete_text, parse_scene
from ldcs_ros.schema.paths import get_value, with_values

SPAN = 4.0  # a parameter without bounds is searched between a quarter and four times its value
LOGARITHMIC = 4.0  # bounds whose ratio is at least this are searched on a logarithmic scale


@dataclass(frozen=True)
class FitParameter:
    """A number of the scene that is to be fitted.

    Attributes:
        path: Its path in the scene, such as effects.arms.joint_stiffness.
        start: Its value in the scene, SI.
        low, high: Bounds.
    """

    path: str
    start: float
    low: float
    high: float

    @property
    def is_start(self) -> bool:
        """One of the numbers of the start of an experiment, not of the scene."""
        return _START.match(self.path) is not None

    @property
    def logarithmic(self) -> bool:
        """Searched on a logarithmic scale."""
        return self.low > 0.0 and self.high >= LOGARITHMIC * self.low

    def value(self, fraction: float) -> float:
        """Return the value at a fraction of the way from low to high."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** fraction)
        return self.low + fraction * (self.high - self.low)

    def fraction(self, value: float) -> float:
        """Return the fraction of the way from low to high at a value."""
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def slope(self, fraction: float) -> float:
        """Return d(value)/d(fraction)."""
        if self.logarithmic:
            return self.value(fraction) * math.log(self.high / self.low)
        return self.high - self.low


def parse_parameter(text: str, content: dict[str, Any]) -> FitParameter:
    """Return the parameter of `PATH` or `PATH=LOW..HIGH`.

    Raises:
        IdentificationError: It cannot be read, names no number, or its bounds do not hold the scene's value.
        SceneError: The path leads nowhere.
    """
    path, _, bounds = text.partition("=")
    if path.strip().startswith("inputs"):
        raise IdentificationError(
            f"--fit {text}: the bags hold the commands; fit their effect, such as effects.arms.pressure_gain"
        )
    start = get_value(content, path.strip())
    if start is None:  # the default of an effect is a number to start from, too
        scene = load_scene(content)
        complete = parse_scene(complete_text(scene), name=scene.name, origin=scene.name)
        start = get_value(complete.content, path.strip())
    if isinstance(start, bool) or not isinstance(start, (int, float)):
        said = "is not given in the scene" if start is None else f"is {start!r}"
        raise IdentificationError(
            f"--fit {text}: {path} {said}, expected a number to start from; set one with --set {path}=VALUE"
        )
    start = float(start)
    if bounds:
        low, high = _bounds(text, bounds)
    elif start == 0.0:
        raise IdentificationError(f"--fit {text}: the scene has 0 there; give bounds, --fit {path}=LOW..HIGH")
    else:
        low, high = sorted((start / SPAN, start * SPAN))
    if not low <= start <= high:
        raise IdentificationError(
            f"--fit {text}: the scene has {start:g}, which is not in {low:g} ... {high:g}"
        )
    return FitParameter(path.strip(), start, low, high)


_START = re.compile(r"^start\[(\d+)\]\.(\d+)$")


def start_parameters(number: int, ranges: Sequence[tuple[float, float, float]]) -> list[FitParameter]:
    """Return the numbers of the start of an experiment, by its index; each range is first value, low and high."""
    return [FitParameter(f"start[{number}].{k}", *one) for k, one in enumerate(ranges)]


def scene_values(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that are those of the scene."""
    return {path: value for path, value in values.items() if not _START.match(path)}


def start_values(values: Mapping[str, float], number: int) -> np.ndarray:
    """Return the values of an experiment's start, by its index, in their order, shape (n_start_values,)."""
    return np.array([value for path, value in values.items() if path.startswith(f"start[{number}].")])


def check_parameters(parameters: Sequence[FitParameter], content: dict[str, Any]) -> None:
    """Check that the scene is sound at every bound.

    Raises:
        IdentificationError: A path is named twice, or the scene refuses a bound.
    """
    paths = [parameter.path for parameter in parameters]
    if len(set(paths)) != len(paths):
        raise IdentificationError(f"a parameter is named twice in {paths}")
    for parameter in parameters:
        for bound in (parameter.low, parameter.high):
            try:
                load_scene(with_values(content, {parameter.path: bound})).build()
            except SceneError as error:
                raise IdentificationError(
                    f"--fit {parameter.path}: the bound {bound:g} is refused: {error}"
                ) from error


def values_at(parameters: Sequence[FitParameter], normalised: np.ndarray) -> dict[str, float]:
    """Return the values by path at fractions of the way between the bounds, shape (n,)."""
    return {p.path: p.value(float(s)) for p, s in zip(parameters, normalised, strict=True)}


def _bounds(text: str, bounds: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in bounds.split(".."))
    except ValueError as error:
        raise IdentificationError(
            f"--fit {text}: cannot read the bounds {bounds!r}; write 0.1..0.5"
        ) from error
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise IdentificationError(
            f"--fit {text}: got bounds {low:g} and {high:g}, expected finite ones, low first"
        )
    return low, high

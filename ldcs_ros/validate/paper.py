"""The paper's numbers of its test (Table I, the radius, the material), and the errors of this twin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

RADIUS = 0.115  # m, at the actuated edges (section III)
YOUNGS_MODULUS = 75.35e3  # Pa, from the paper's tensile test (section IV.A)
SIDE = 0.140  # m
PRESSURE = 140e3  # Pa, 1.4 bar, taken as gauge

POINTS = ("P0", "P1")
AXES = ("x", "y", "z")

# Table I, steady displacement in ldcs_base [mm].
MODEL = {"P0": (-1.3, 0.0, 18.8), "P1": (-21.8, 0.0, 69.9)}
EXPERIMENT = {"P0": (-2.0, 0.0, 18.2), "P1": (-22.9, 0.0, 68.7)}


class Committed(NamedTuple):
    """Errors of the shipped calibrated scene against the experiment [mm], against which later ones are compared."""

    P0: tuple[float, float, float]
    P1: tuple[float, float, float]


COMMITTED = Committed(P0=(0.19, 0.0, 0.36), P1=(-0.16, 0.0, -0.21))
GROWTH = 0.05  # mm by which the size of an error may grow before `ldcs validate` fails


def errors(displacement: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return displacement minus experiment [mm], shape (3,), by point."""
    return {name: np.asarray(displacement[name]) - EXPERIMENT[name] for name in POINTS}


def grown(displacement: dict[str, np.ndarray]) -> list[str]:
    """Return a line for each error that is more than `GROWTH` above the committed one.

    Args:
        displacement: Displacement of each point [mm], shape (3,).
    """
    lines = []
    for name, error in errors(displacement).items():
        for axis, now, before in zip(AXES, error, getattr(COMMITTED, name), strict=True):
            if abs(now) > abs(before) + GROWTH:
                lines.append(
                    f"{name} u{axis}: error {now:+.2f} mm, committed {before:+.2f} mm, may grow by {GROWTH} mm"
                )
    return lines


def worst(displacement: dict[str, np.ndarray]) -> float:
    """Return the largest error against the experiment [mm]; displacements have shape (3,)."""
    return max(float(np.abs(error).max()) for error in errors(displacement).values())

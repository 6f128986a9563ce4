"""The sheets of `ldcs validate --mechanics`: sizes, material and shapes that lattice and references have in common."""

from __future__ import annotations

import numpy as np

YOUNGS_MODULUS, POISSON, DENSITY = 150e3, 1.0 / 3.0, 1070.0
THICKNESS = 0.006
LENGTH, WIDTH = 0.200, 0.050  # of the strip [m]
SIDE = 0.140  # of the plate [m]
HOLED_WIDTH, HOLE_RADIUS = 0.100, 0.025  # of the strip with a hole, and of that whose width falls [m]
INCLUSION_SIDE, INCLUSION_FACTOR = 0.070, 5.0
"""Side of the stiff square in the middle of the plate [m], and the factor of its stiffness."""
TAPER = 0.5
"""Thickness, or width, at the tip of a tapered strip over that at its clamp."""
TAPER_STEPS = 8
SHEAR_FACTOR = 1.343146
"""In-plane shear modulus of the material's lattice over the isotropic one: the formulas of `Material` at 1/3."""


def stepped_thickness(x: np.ndarray) -> np.ndarray:
    """Return the thickness of the strip that becomes thinner in steps [m], at places along it [m], shape (n,)."""
    step = np.clip(np.floor(TAPER_STEPS * x / LENGTH), 0, TAPER_STEPS - 1)
    return np.asarray(THICKNESS * (1.0 - (1.0 - TAPER) * (step + 0.5) / TAPER_STEPS))


def tapered_half_width(x: np.ndarray) -> np.ndarray:
    """Return half the width of the strip that becomes narrower [m], at places along it [m], shape (n,)."""
    return np.asarray(0.5 * HOLED_WIDTH * (1.0 - (1.0 - TAPER) * x / LENGTH))

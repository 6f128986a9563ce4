"""One comparison of the mechanics: a quantity of the lattice on several meshes beside its reference."""

from __future__ import annotations

import math
from dataclasses import dataclass

# Meshes that differ by less, relatively, differ by rounding.
ROUNDING = 1e-7
LIMITS = {
    "beam": (
        "the reference is a beam's: the clamp holds back the lateral contraction of the strip. Against the plate "
        "of finite elements the same strip is within 0.5 %"
    ),
    "shear": (
        "central springs tie the in-plane shear stiffness to Poisson's ratio: with a material it is 1.34 times that of "
        "an isotropic sheet at 1/3. No factor corrects it beside stretching; where shear alone counts, divide "
        "youngs_modulus by 1.34"
    ),
    "two layers": (
        "springs of one stiffness store too much in bending, because both layers carry most of the stretching. Divide "
        "the stiffness by the factor of the row where bending counts, or give a material"
    ),
    "cut cells": (
        "a slanted or round outline is a stair of nodes; cells that it cuts count with the area that is left. Sums "
        "over the sheet converge; the strain at one place of a stair does so slowly"
    ),
    "torsion": (
        "lumped masses and few cells across twist a narrow strip too slowly: order 1.5. A beam's reference has the "
        "softer sides, 0.63 t / b, but not the clamp that keeps the end from warping"
    ),
    "flat": (
        "the reference buckles from the flat strip; its bending in the plane before raises the load by 1.8 %, "
        "1 / sqrt((1 - EI / EI')(1 - GJ / EI')) with EI' in the plane"
    ),
}
"""What makes the lattice and a reference differ, by the name that a row gives."""


@dataclass(frozen=True)
class Benchmark:
    """A quantity of the lattice on several meshes, beside its reference.

    Attributes:
        name: What is compared.
        reference: Reference value, SI.
        values: Values of the lattice, SI, by number of nodes along the side.
        limit: Names in `LIMITS` of what makes them differ, with commas; '' where they should agree.
    """

    name: str
    reference: float
    values: dict[int, float]
    limit: str

    @property
    def errors(self) -> dict[int, float]:
        """Relative errors by number of nodes."""
        return {nodes: value / self.reference - 1.0 for nodes, value in self.values.items()}

    @property
    def order(self) -> float:
        """Order of convergence towards the lattice's own limit, from the last three meshes; NaN without one."""
        *_, a, b, c = self.values.values()
        ratio = (a - b) / (b - c) if abs(b - c) > ROUNDING * abs(c) else math.nan
        return math.log2(ratio) if ratio > 0.0 else math.nan

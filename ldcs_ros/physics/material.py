"""From a material to the stiffness of each spring family, so that results converge as the lattice is refined.

A sheet has thickness t, modulus E and Poisson's ratio v. In plane stress its membrane stiffnesses are
C11 = E t / (1 - v^2) and C12 = v C11, and its bending stiffness is C11 t^2 / 12. Two layers t apart that carried all of
C11 would bend like C11 t^2 / 4, three times too stiff. Springs from one layer to the other resist stretching but
not bending (their two ends stretch by opposite amounts), so

    the springs inside the layers carry 1/3 of the membrane stiffness: all of the bending,
    the inclined springs between the layers carry 2/3 of it: none of the bending.

Cells are dx x dy, and springs are central. A spring of length l has its ends (a dx, b dy, h) apart, and a cell has n
of its kind. An area stores 1/2 w (a dx^2 e_xx + b dy^2 e_yy + h^2 e_zz)^2 in it, w = n k / (l^2 dx dy); shear terms
cancel in pairs. Inside a layer (h = 0) the kinds along x, y and the diagonals have the weights

    w_d = C12 / (dx dy)^2,    w_x = C11 / dx^4 - w_d,    w_y = C11 / dy^4 - w_d,

which makes k independent of the cell's size. Between the layers (h = t) the springs also shorten the sheet's
thickness. Z is the stiffness against e_zz: the springs straight across add the part that the inclined ones lack.
With e_zz eliminated,

    X - X^2 t^4 / Z = C11 / dx^4,   Y likewise with dy,   w_d = C12 / (dx dy)^2 + X Y t^4 / Z,
    w_x = X - w_d,   w_y = Y - w_d,   w_z = Z - (w_x + w_y + w_d) t^4.

Their k grow like (t / dx)^2: the two families need different scaling.

Central springs tie the stiffness in plane shear to C12. The springs inside the layers have it right for v = 1/3.
Those between raise it to 1.3 times that of an isotropic sheet for v = 1/3, and to 2.4 times for v = 1/2.
Springs on a free edge, also that of a hole, belong to half a cell and have half the stiffness; masses follow the
node's area. A cell that a hole cuts counts with the fraction of its area that is left. Where a region has a factor
on the thickness, t is that of each cell: membrane stiffness and mass grow like t, bending stiffness like t^3. Factors
on stiffness and mass multiply what the thickness gives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.schema.fields import REQUIRED, quantity

IN_LAYER_FRACTION = 1.0 / 3.0
# Z t^-4 over the mean of C11 / dx^4 and C11 / dy^4: above 4 there is a solution; larger is stiffer to integrate.
ACROSS_RATIO = 8.0


@dataclass(frozen=True, kw_only=True)
class Material:
    """A soft, damped, elastic material; an alternative to mass, spring stiffness and damping.

    Attributes:
        youngs_modulus: Young's modulus E [Pa].
        poisson: Poisson's ratio.
        density: Density [kg/m^3].
        relaxation_time: Damping over stiffness of every spring, c / k [s].
    """

    youngs_modulus: float = quantity(
        REQUIRED, "Pa", "Young's modulus", low=1e-3, high=1e12, source="paper: 75.35e3"
    )
    poisson: float = quantity(REQUIRED, "", "Poisson's ratio", low=0.05, high=0.5, source="paper: 0.5")
    density: float = quantity(
        REQUIRED, "kg/m^3", "density", low=1e-3, high=1e5, source="paper: 160 g over 196 cm^3, 816"
    )
    relaxation_time: float = quantity(
        0.0625, "s", "damping over stiffness", low=0.0, high=1e3, source="paper: c / k = 5 / 80"
    )

    def mass(self, size: tuple[float, float, float]) -> float:
        """Return the mass of a sheet of a size [kg]."""
        return self.density * size[0] * size[1] * size[2]

    def stiffness(self, lattice: Lattice, quantity: str = "stiffness") -> np.ndarray:
        """Return the stiffness of each spring of a lattice [N/m], shape (n_springs,).

        Args:
            lattice: The lattice.
            quantity: Factor of the regions that scales it: stiffness, or damping for that of the dampers.

        Raises:
            ValueError: The cells are too far from square for this Poisson's ratio.
        """
        scale, factors = (
            lattice.cell_factor("whole") * lattice.cell_factor(quantity),
            lattice.cell_factor("thickness"),
        )
        stiffness = np.zeros(len(lattice.springs))
        for factor in np.unique(factors):
            # Cells of one thickness at a time; a spring on their border has its part of both sides.
            cells = lattice.mean_of_cells(scale * (factors == factor))
            stiffness += self._uniform(lattice, factor * lattice.size[2]) * cells
        return stiffness

    def _uniform(self, lattice: Lattice, thickness: float) -> np.ndarray:
        """Return the stiffness of each spring in a sheet of one thickness [m] without holes, shape (n_springs,)."""
        nx, ny = lattice.nodes
        dx, dy = lattice.spacing
        place = np.stack(np.unravel_index(lattice.springs, (2, nx, ny)), axis=-1)
        between, along_x, along_y = np.abs(place[:, 1] - place[:, 0]).T.astype(bool)
        at_side = np.isin(place[:, 0, 2], (0, ny - 1)) & np.isin(place[:, 1, 2], (0, ny - 1))
        at_end = np.isin(place[:, 0, 1], (0, nx - 1)) & np.isin(place[:, 1, 1], (0, nx - 1))
        stiffness = np.empty(len(lattice.springs))
        c11 = self.youngs_modulus * thickness / (1.0 - self.poisson**2)
        for height, fraction, count in (
            (0.0, IN_LAYER_FRACTION / 2, 1.0),
            (thickness, 1.0 - IN_LAYER_FRACTION, 2.0),
        ):
            chosen = between if height else ~between
            weights = self._weights(fraction * c11, dx, dy, height)
            kinds = (
                (along_x & ~along_y, dx, 0.0),
                (along_y & ~along_x, 0.0, dy),
                (along_x & along_y, dx, dy),
            )
            for weight, (kind, x, y) in zip(weights, kinds, strict=False):
                n = 2.0 * count if x and y else count
                stiffness[chosen & kind] = weight * (x * x + y * y + height**2) * dx * dy / n
            if height:
                stiffness[between & ~along_x & ~along_y] = weights[3] * dx * dy / height**2
        stiffness[at_side & ~along_y] *= 0.5
        stiffness[at_end & ~along_x] *= 0.5
        return stiffness

    def _weights(self, c11: float, dx: float, dy: float, height: float) -> tuple[float, float, float, float]:
        # w_x, w_y, w_d and w_z of the module's formulas for a family that carries C11.
        x, y, diagonal = c11 / dx**4, c11 / dy**4, self.poisson * c11 / (dx * dy) ** 2
        reach = height**4
        total = ACROSS_RATIO * 0.5 * (x + y) * reach
        if height:
            x, y = (
                0.5 * total * (1.0 - math.sqrt(max(0.0, 1.0 - 4.0 * w * reach / total))) / reach
                for w in (x, y)
            )
            diagonal += x * y * reach / total
        across = total - (x + y - diagonal) * reach
        if min(x, y) <= diagonal or across < 0.0:
            raise ValueError(
                f"material: cells of {1e3 * dx:g} x {1e3 * dy:g} mm are too far from square for a Poisson's ratio "
                f"of {self.poisson:g}; choose numbers of nodes that make them more square"
            )
        return x - diagonal, y - diagonal, diagonal, across

"""Finite-element answers, written by tools/make_finite_elements.py; do not edit."""

from __future__ import annotations

HOLED = (4.37283, 2.49838, 4.08039)
"""Strip with a hole, a gross strain: strain at its side, beside it over its diameter, its elongation."""
HOLED_OF_LATTICE_SHEAR = (4.1806, 2.45515, 3.88491)
"""The same with the shear stiffness of the lattice."""
INCLUSION = 0.758854
"""Stretched square with a stiff square inside: extension over its length, a strain."""
INCLUSION_OF_LATTICE_SHEAR = 0.756833
"""The same with the shear stiffness of the lattice."""
STRIP_SAG = -64.2435
"""Cantilever plate: sag under its weight, times E / (density g) [m^2 / m]."""
TAPERED_THICKNESS_SAG = -59.5183
"""The same with a thickness that falls in steps."""
TAPERED_WIDTH_SAG = -45.1961
"""The same with a width that falls."""
STRIP_FREQUENCIES = (0.0246928, 0.154408, 0.196563)
"""Cantilever plate: frequencies of bending (two), torsion times sqrt(density / E) [1/m]."""
LATERAL_LOAD = 1.26743e-07
"""Cantilever plate: force in its plane at the tip that buckles it, over E [m^2]."""

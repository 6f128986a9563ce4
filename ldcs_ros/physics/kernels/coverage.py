"""Which models the compiled force of all effects covers; read before any of its code is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.physics.model import Model

if TYPE_CHECKING:
    from ldcs_ros.physics.effects.springs import AxialTerm

# Effects whose force is in the tables, is constant, or is handed over for each step.
SERVED = (
    "springs",
    "gravity",
    "force",
    "arms",
    "support",
    "floor",
    "drag",
    "payload",
    "clamp",
    "driven_edges",
    "wrench",
)
# A lattice without holes has 13; node numbers that a hole shifts would give ever more.
MOST_FAMILIES = 32


def is_covered(model: Model) -> bool:
    """Return whether the compiled force (`TotalForce`) knows all effects of a model."""
    if not HAVE_NUMBA or any(term.name not in SERVED for term in model.terms):
        return False
    for term in model.terms:
        if term.name == "springs":
            from ldcs_ros.physics.effects.springs import AxialTerm

            if not isinstance(term, AxialTerm) or len(spring_offsets(term)) > MOST_FAMILIES:
                return False
    return True


def spring_offsets(term: AxialTerm) -> np.ndarray:
    """Return the differences of node numbers that springs join, in rising order, shape (n_offsets,)."""
    return np.unique(term.b - term.a)

"""Rigid plates under the arms' first part, on which the sheet rests before actuation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.contact import PlaneContact
from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.schema.fields import quantity


@dataclass(frozen=True, kw_only=True)
class Support(Effect):
    """Two plates that push up and never pull: under bottom nodes near the side edges and near the clamp.

    A node belongs to a plate by its place at rest: within `length` of the clamped edge and in the rows
    0 ... `width` from a side edge (paper, section IV.A: plates of one third of the sheet's length).

    Attributes:
        length: Part of the sheet's length that the plates reach.
        width: Cells from each side edge that lie on a plate.
        stiffness: Contact stiffness of a node [N/m].
        damping: Fraction of the contact force that a closing speed of 1 m/s adds [s/m].
        onset: Penetration over which the stiffness grows from 0 to its value [m].
    """

    name: ClassVar[str] = "support"
    length: float = quantity(
        1.0 / 3.0, "", "part of the sheet's length", low=0.0, high=1.0, source="paper, section IV.A"
    )
    width: int = quantity(1, "", "cells from each side edge that lie on a plate", low=0, high=64)
    stiffness: float = quantity(1000.0, "N/m", "contact stiffness of a node", low=0.0, high=1e8)
    damping: float = quantity(
        10.0, "s/m", "fraction of the force added by 1 m/s of closing speed", low=0.0, high=1e4
    )
    onset: float = quantity(1e-4, "m", "penetration over which stiffness sets in", low=1e-9, high=0.1)

    def bind(self, assembly: Assembly) -> Term:
        """Return the contact of the supported nodes with the plates."""
        lattice = assembly.lattice
        nx, ny = lattice.nodes
        # The slack is rounding only: a node exactly on the plate's end is supported.
        columns = np.flatnonzero(np.linspace(0.0, 1.0, nx) <= self.length + 1e-9)
        rows = np.array([j for j in range(ny) if min(j, ny - 1 - j) <= self.width])
        nodes = lattice.index[0][np.ix_(columns, rows)].ravel()
        return PlaneContact(
            self.name,
            nodes,
            height=-0.5 * lattice.size[2],
            stiffness=self.stiffness,
            damping=self.damping,
            contact_width=self.onset,
        )

"""A horizontal plane that no node passes: contact of the whole sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics.contact import PlaneContact
from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.schema.fields import REQUIRED, quantity


@dataclass(frozen=True, kw_only=True)
class Floor(Effect):
    """A frictionless contact plane under every node of both layers.

    Attributes:
        height: Its z in ldcs_base [m].
        stiffness: Contact stiffness of a node [N/m].
        damping: Fraction of the contact force that a closing speed of 1 m/s adds [s/m].
        onset: Penetration over which the stiffness grows from 0 to its value [m].
    """

    name: ClassVar[str] = "floor"
    height: float = quantity(
        REQUIRED, "m", "z of the plane in ldcs_base", low=-10.0, high=10.0, source="scene"
    )
    stiffness: float = quantity(1000.0, "N/m", "contact stiffness of a node", low=0.0, high=1e8)
    damping: float = quantity(
        10.0, "s/m", "fraction of the force added by 1 m/s of closing speed", low=0.0, high=1e4
    )
    onset: float = quantity(1e-4, "m", "penetration over which stiffness sets in", low=1e-9, high=0.1)

    def bind(self, assembly: Assembly) -> Term:
        """Return the contact of all nodes with the plane."""
        return PlaneContact(
            self.name,
            np.arange(assembly.lattice.n_nodes),
            height=self.height,
            stiffness=self.stiffness,
            damping=self.damping,
            contact_width=self.onset,
        )

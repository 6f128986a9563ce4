"""ESDIRK4(3)6L[2]SA: fourth order, L-stable, five implicit stages with one matrix; the default method."""

from __future__ import annotations

from typing import ClassVar

from ldcs_ros.integrators.implicit.esdirk import Dirk
from ldcs_ros.integrators.tableaux import ESDIRK43, Tableau


class Esdirk43(Dirk):
    """Kennedy and Carpenter's pair of orders four and three: stage order two, so damping costs it no order here."""

    name: ClassVar[str] = "esdirk43"
    order: ClassVar[int] = ESDIRK43.order
    error_order: ClassVar[int] = ESDIRK43.error_order
    tableau: ClassVar[Tableau] = ESDIRK43

"""TR-BDF2: second order, L-stable, two implicit stages; cheap steps where commands keep steps short."""

from __future__ import annotations

from typing import ClassVar

from ldcs_ros.integrators.implicit.esdirk import Dirk
from ldcs_ros.integrators.tableaux import TRBDF2, Tableau


class TrBdf2(Dirk):
    """Trapezoidal rule, then the second backward differentiation formula, with an embedded third-order estimate."""

    name: ClassVar[str] = "trbdf2"
    order: ClassVar[int] = TRBDF2.order
    error_order: ClassVar[int] = TRBDF2.error_order
    tableau: ClassVar[Tableau] = TRBDF2

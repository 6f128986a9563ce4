"""`RawReading`: one number or place that a rig reported, in SI, with the rig's stamp and the time it came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the output process reads the names of the arms and loads no NumPy
    import numpy as np

KINDS = ("pressure", "pressure_command", "position")


@dataclass(frozen=True)
class RawReading:
    """One value from a rig.

    Attributes:
        kind: 'pressure' (measured), 'pressure_command' (the set-point the rig works to) or 'position'.
        name: Arm or point.
        value: Gauge pressure [Pa], shape (), or position in ldcs_base [m], shape (3,).
        received: Time of its arrival [s of the bridge's steady clock].
        source: Link or topic that carried it; each source has a clock of its own.
        stamp: Stamp of the rig [s of the rig's clock]; None for none.
        age: Age of the value at its stamp, or at its arrival without one [s].
    """

    kind: str
    name: str
    value: np.ndarray
    received: float
    source: str
    stamp: float | None = None
    age: float = 0.0

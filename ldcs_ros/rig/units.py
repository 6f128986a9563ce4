"""Units of pressure of rigs, converted once when a message arrives or leaves."""

from __future__ import annotations

from dataclasses import dataclass

from ldcs_ros.errors import BridgeError
from ldcs_ros.schema.units import PRESSURE, STANDARD_ATMOSPHERE

# The units of mapping files: one table for a rig on the wire and in a bag.
PASCALS: dict[str, float] = PRESSURE
REFERENCES = ("gauge", "absolute")
AMBIENT = STANDARD_ATMOSPHERE


@dataclass(frozen=True)
class PressureUnit:
    """The notation of a rig for pressures.

    Attributes:
        name: One of PASCALS.
        reference: 'gauge' or 'absolute'.
        ambient: Absolute pressure of the air [Pa], subtracted from absolute pressures.
    """

    name: str = "Pa"
    reference: str = "gauge"
    ambient: float = AMBIENT

    def __post_init__(self) -> None:
        if self.name not in PASCALS:
            raise BridgeError(f"unknown unit {self.name!r} of pressure; expected one of {list(PASCALS)}")
        if self.reference not in REFERENCES:
            raise BridgeError(f"unknown reference {self.reference!r}; expected one of {list(REFERENCES)}")

    def to_pascal(self, value: float) -> float:
        """Return the gauge pressure [Pa] of a value of the rig."""
        return value * PASCALS[self.name] - (self.ambient if self.reference == "absolute" else 0.0)

    def from_pascal(self, gauge: float) -> float:
        """Return the rig's value for a gauge pressure [Pa]."""
        return (gauge + (self.ambient if self.reference == "absolute" else 0.0)) / PASCALS[self.name]

    @property
    def step(self) -> float:
        """One unit [Pa]."""
        return PASCALS[self.name]

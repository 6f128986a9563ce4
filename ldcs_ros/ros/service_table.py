"""The services of the three nodes as data, for the reference; a test compares them with what the nodes offer."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ServiceEntry:
    """One service or action.

    Attributes:
        name: Name, relative to the node ('~/') or to its namespace.
        type: ROS service or action type.
        meaning: What it does, and when it refuses.
    """

    name: str
    type: str
    meaning: str


_TRIGGER = "std_srvs/srv/Trigger"

SIM_SERVICES = (
    ServiceEntry("~/pause", _TRIGGER, "time stands still; commands are taken and act when it goes on"),
    ServiceEntry("~/resume", _TRIGGER, "time goes on, without a burst to catch up"),
    ServiceEntry("~/step", _TRIGGER, "exactly one publish period; only while paused"),
    ServiceEntry(
        "~/reset", _TRIGGER, "back to the start of the scene, running or paused as before; a new bag begins"
    ),
    ServiceEntry(
        "~/rearm", _TRIGGER, "commands for the arms are accepted again after the watchdog has tripped"
    ),
)
BRIDGE_SERVICES = (
    ServiceEntry(
        "~/arm",
        _TRIGGER,
        "mode live: commands go to the rig from now on; refused with every reason that there is",
    ),
    ServiceEntry("~/disarm", _TRIGGER, "vents along a ramp; commands are refused until somebody arms again"),
)

"""GetSimulatorFeatures: what this node really offers, with the installed version of the interfaces."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from simulation_interfaces.msg import SimulatorFeatures

from ldcs_ros import __version__

# Service -> the features that it stands for.
FEATURES: dict[str, tuple[str, ...]] = {
    "GetEntities": ("ENTITY_TAGS", "ENTITY_CATEGORIES", "ENTITY_BOUNDS_BOX"),
    "GetEntityState": ("ENTITY_STATE_GETTING",),
    "GetEntityInfo": ("ENTITY_INFO_GETTING",),
    "ResetSimulation": ("SIMULATION_RESET",),
    "GetSimulationState": ("SIMULATION_STATE_GETTING",),
    "SetSimulationState": ("SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE"),
    "StepSimulation": ("STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE"),
    "SimulateSteps": ("STEP_SIMULATION_ACTION",),
    "GetCurrentWorld": ("WORLD_INFO_GETTING",),
    "LoadWorld": ("WORLD_LOADING", "WORLD_RESOURCE_STRING"),
    "GetAvailableWorlds": ("AVAILABLE_WORLDS", "WORLD_TAGS"),
}

_REMARKS = (
    f"ldcs_ros {__version__}. A step is one publish period (parameter publish_rate). ResetSimulation takes time and "
    "state back together: a run must be repeatable from its bag. Entities are points, nodes and the arms' links; "
    "loads act on them through external_wrench."
)


class Features:
    """Answers GetSimulatorFeatures.

    Args:
        offered: Names of the services and actions that are offered.
    """

    def __init__(self, offered: Iterable[str]) -> None:
        names = [name for service in offered for name in FEATURES.get(service, ())]
        # A version of the interfaces that does not know a feature cannot be told of it.
        known = [getattr(SimulatorFeatures, name) for name in names if hasattr(SimulatorFeatures, name)]
        self._numbers = sorted(known)

    def tell(self, request: Any, response: Any) -> None:
        """Fill the answer."""
        response.features.features = self._numbers
        response.features.custom_info = _REMARKS

"""All standard simulator services of the node, and the features that it offers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from simulation_interfaces.msg import SimulatorFeatures

from ldcs_ros import __version__
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.ros.simulator.answers import offer_service
from ldcs_ros.ros.simulator.control import Control, Host, Stepping
from ldcs_ros.ros.simulator.entity_services import EntityServices

if TYPE_CHECKING:
    from simulation_interfaces.srv import GetSimulatorFeatures

# Service -> its features.
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
        # Older versions of the interfaces lack some of these features.
        known = [getattr(SimulatorFeatures, name) for name in names if hasattr(SimulatorFeatures, name)]
        self._numbers = sorted(known)

    def report(self, request: GetSimulatorFeatures.Request, response: GetSimulatorFeatures.Response) -> None:
        """Report the features."""
        response.features.features = self._numbers
        response.features.custom_info = _REMARKS


class SimulatorServices:
    """Offers `~/get_simulator_features` and the services that it lists, in every state of the node.

    Args:
        node: The node that offers them.
        host: The same node, as the holder of the runner.
        loader: Loader of scenes.
        files: Resolver of paths.

    Attributes:
        offered: Names of the types of all services and actions.
    """

    def __init__(self, node: LifecycleNode, host: Host, loader: SceneLoader, files: GraphFiles) -> None:
        control, entities = Control(host), EntityServices(host)
        handlers: dict[str, Callable[..., None]] = {
            "GetSimulationState": control.report_state,
            "SetSimulationState": control.change_state,
            "ResetSimulation": control.reset,
            "GetEntities": entities.names,
            "GetEntitiesStates": entities.states,
            "GetEntityState": entities.state,
            "GetEntityInfo": entities.info,
            "SetEntityState": entities.refuse_to_set,
        }
        self.offered = [name for name, handle in handlers.items() if offer_service(node, name, handle)]
        self.offered += _offer_worlds(node, host, loader, files)
        self._stepping = Stepping(node, host)
        self.offered += self._stepping.offered
        offer_service(node, "GetSimulatorFeatures", Features(self.offered).report)

    def close(self) -> None:
        """Withdraw the action; services go with the node."""
        self._stepping.close()


def _offer_worlds(node: LifecycleNode, host: Host, loader: SceneLoader, files: GraphFiles) -> list[str]:
    try:
        from ldcs_ros.ros.simulator.worlds import Worlds
    except ImportError:
        # The first version of the interfaces had no worlds.
        return []
    worlds = Worlds(host, loader, files)
    handlers = {"GetAvailableWorlds": worlds.available, "GetCurrentWorld": worlds.current}
    offered = [name for name, handle in handlers.items() if offer_service(node, name, handle)]
    return offered + (
        ["LoadWorld"] if offer_service(node, "LoadWorld", worlds.load, group=ReentrantCallbackGroup()) else []
    )

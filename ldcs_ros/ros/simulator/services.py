"""All standard simulator services of the node together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode

from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.ros.simulator.answers import offer
from ldcs_ros.ros.simulator.control import Control
from ldcs_ros.ros.simulator.entity_services import EntityServices
from ldcs_ros.ros.simulator.features import Features
from ldcs_ros.ros.simulator.host import Host
from ldcs_ros.ros.simulator.stepping import Stepping


class SimulatorServices:
    """Offers `~/get_simulator_features` and what it lists, in every state of the node.

    Args:
        node: The node that offers them.
        host: The same node, as what has the runner.
        loader: What loads scenes.

    Attributes:
        offered: Names of the types of all services and actions.
    """

    def __init__(self, node: LifecycleNode, host: Host, loader: SceneLoader) -> None:
        control, entities = Control(host), EntityServices(host)
        handlers: dict[str, Callable[[Any, Any], None]] = {
            "GetSimulationState": control.get_state,
            "SetSimulationState": control.set_state,
            "ResetSimulation": control.reset,
            "GetEntities": entities.names,
            "GetEntitiesStates": entities.states,
            "GetEntityState": entities.state,
            "GetEntityInfo": entities.info,
            "SetEntityState": entities.refuse_to_set,
        }
        self.offered = [name for name, handle in handlers.items() if offer(node, name, handle)]
        self.offered += _offer_worlds(node, host, loader)
        self._stepping = Stepping(node, host)
        self.offered += self._stepping.offered
        offer(node, "GetSimulatorFeatures", Features(self.offered).tell)

    def close(self) -> None:
        """Withdraw the action; services go with the node."""
        self._stepping.close()


def _offer_worlds(node: LifecycleNode, host: Host, loader: SceneLoader) -> list[str]:
    try:
        from ldcs_ros.ros.simulator.worlds import Worlds
    except ImportError:
        # The first version of the interfaces had no worlds.
        return []
    worlds = Worlds(host, loader)
    handlers = {"GetAvailableWorlds": worlds.available, "GetCurrentWorld": worlds.current}
    offered = [name for name, handle in handlers.items() if offer(node, name, handle)]
    return offered + (
        ["LoadWorld"] if offer(node, "LoadWorld", worlds.load, group=ReentrantCallbackGroup()) else []
    )

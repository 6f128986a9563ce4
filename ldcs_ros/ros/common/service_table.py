"""The services of the three nodes as data, for the reference; a test compares them with what the nodes offer."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ServiceEntry:
    """One service or action.

    Attributes:
        name: Name, relative to the node ('~/') or to its namespace.
        type: ROS service or action type.
        meaning: Its effect, and its refusals.
    """

    name: str
    type: str
    meaning: str


_TRIGGER = "std_srvs/srv/Trigger"
_SIMULATOR = "simulation_interfaces/srv/"

SIM_SERVICES = (
    ServiceEntry("~/pause", _TRIGGER, "stops time; commands are taken and act when it goes on"),
    ServiceEntry("~/resume", _TRIGGER, "time goes on, without a burst to catch up"),
    ServiceEntry("~/step", _TRIGGER, "exactly one publish period; only while paused"),
    ServiceEntry(
        "~/reset", _TRIGGER, "back to the start of the scene, running or paused as before; a new bag begins"
    ),
    ServiceEntry(
        "~/rearm", _TRIGGER, "commands for the arms are accepted again after the watchdog has tripped"
    ),
    ServiceEntry(
        "~/advance",
        "ldcs_msgs/srv/Advance",
        "lock-step: applies a command, advances by a duration, returns the state; only while paused",
    ),
    ServiceEntry(
        "~/apply_wrench",
        "ldcs_msgs/srv/ApplyWrench",
        "a wrench at a point for a while, with a ramp up and down",
    ),
    ServiceEntry(
        "~/load_scene",
        "ldcs_msgs/srv/LoadScene",
        "another scene without a restart; built while the old one runs on, which stays if it is refused",
    ),
    ServiceEntry(
        "~/reach",
        "ldcs_msgs/srv/Reach",
        "commands whose rest state comes nearest to places or a shape, by a model beside the running twin",
    ),
    ServiceEntry(
        "~/get_simulator_features",
        f"{_SIMULATOR}GetSimulatorFeatures",
        "features of these services that the node offers",
    ),
    ServiceEntry("~/get_simulation_state", f"{_SIMULATOR}GetSimulationState", "playing, paused or stopped"),
    ServiceEntry(
        "~/set_simulation_state",
        f"{_SIMULATOR}SetSimulationState",
        "play, pause, stop (back to the start) or quit",
    ),
    ServiceEntry(
        "~/reset_simulation", f"{_SIMULATOR}ResetSimulation", "back to the start, time and state together"
    ),
    ServiceEntry(
        "~/step_simulation", f"{_SIMULATOR}StepSimulation", "a number of publish periods; only while paused"
    ),
    ServiceEntry(
        "~/simulate_steps",
        "simulation_interfaces/action/SimulateSteps",
        "action: the same with feedback after each step; can be cancelled",
    ),
    ServiceEntry(
        "~/get_entities", f"{_SIMULATOR}GetEntities", "names of points, nodes and links, by filters"
    ),
    ServiceEntry("~/get_entities_states", f"{_SIMULATOR}GetEntitiesStates", "their states at one instant"),
    ServiceEntry("~/get_entity_state", f"{_SIMULATOR}GetEntityState", "pose, twist and acceleration of one"),
    ServiceEntry("~/get_entity_info", f"{_SIMULATOR}GetEntityInfo", "category and tags of one"),
    ServiceEntry(
        "~/set_entity_state", f"{_SIMULATOR}SetEntityState", "refused: the sheet moves as its physics says"
    ),
    ServiceEntry(
        "~/get_available_worlds",
        f"{_SIMULATOR}GetAvailableWorlds",
        "the shipped scenes, by the effects as tags",
    ),
    ServiceEntry("~/get_current_world", f"{_SIMULATOR}GetCurrentWorld", "the scene that is loaded, whole"),
    ServiceEntry(
        "~/load_world", f"{_SIMULATOR}LoadWorld", "a scene by name, path or text; left stopped at its start"
    ),
)
BRIDGE_SERVICES = (
    ServiceEntry(
        "~/arm",
        _TRIGGER,
        "mode live: commands go to the rig from now on; refused with every reason that there is",
    ),
    ServiceEntry("~/disarm", _TRIGGER, "vents along a ramp; commands are refused until the next arming"),
)

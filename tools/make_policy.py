"""Write the SROS2 policy of the three nodes from the tables of the code: it permits their actions and nothing else.

python tools/make_policy.py                                  writes ldcs_ros/config/sros2_policy.xml
python tools/make_policy.py --scene my.yaml --rig my_rig.yaml -o my_policy.xml    for other points, other rigs
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from ldcs_ros import load_scene
from ldcs_ros.messages.topics import TOPICS, expand
from ldcs_ros.mock_rig.topics import COMMAND, SETPOINT, TRACKER
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import Mode
from ldcs_ros.rig.rig_file import load_rig, shipped_rigs
from ldcs_ros.rig.topic_link import TopicSettings
from ldcs_ros.ros.common.service_table import BRIDGE_SERVICES, SIM_SERVICES, ServiceEntry

POLICY = Path(__file__).resolve().parents[1] / "ldcs_ros/config/sros2_policy.xml"
EXPLANATION = """
  The permissions of each node under SROS2, written by tools/make_policy.py from the tables of the code: everything
  that it uses, and nothing else. Senders of commands and readers have policies of their own: docs/security.md.
"""

# Services and topics of rclpy in every node, and in every lifecycle node.
NODE_TOPICS = ("/parameter_events", "/rosout")
NODE_SERVICES = (
    "~/describe_parameters",
    "~/get_parameter_types",
    "~/get_parameters",
    "~/get_type_description",
    "~/list_parameters",
    "~/set_parameters",
    "~/set_parameters_atomically",
)
LIFECYCLE_TOPICS = ("~/transition_event",)
LIFECYCLE_SERVICES = (
    "~/change_state",
    "~/get_available_states",
    "~/get_available_transitions",
    "~/get_state",
    "~/get_transition_graph",
)
CLOCK = "/clock"


@dataclass
class Permissions:
    """The permissions of a node; names as ROS takes them: absolute, relative to its namespace, or '~/' to itself."""

    namespace: str
    node: str
    publish: set[str] = field(default_factory=set)
    subscribe: set[str] = field(default_factory=set)
    reply: set[str] = field(default_factory=set)
    execute: set[str] = field(default_factory=set)

    @property
    def enclave(self) -> str:
        """The enclave that the node runs in."""
        return f"{self.namespace.rstrip('/')}/{self.node}"


def sim_permissions(scene: str) -> Permissions:
    """Return what the live twin does, with every option on and every optional package installed."""
    services, actions = _split(SIM_SERVICES)
    return Permissions(
        "/ldcs",
        "ldcs_sim",
        publish={*_reports(scene), *NODE_TOPICS, *LIFECYCLE_TOPICS},
        # With use_sim_time, which it takes as the clock that it is itself, rclpy listens too.
        subscribe={*(name for name, topic in TOPICS.items() if topic.direction == "in"), CLOCK},
        reply={*services, *NODE_SERVICES, *LIFECYCLE_SERVICES},
        execute=set(actions),
    )


def bridge_permissions(scene: str, rigs: Iterable[str]) -> Permissions:
    """Return what the bridge does with any of these rigs, or with the mock rig."""
    services, actions = _split(BRIDGE_SERVICES)
    permissions = Permissions(
        "/ldcs",
        "ldcs_bridge",
        publish={*NODE_TOPICS, COMMAND},
        subscribe={"pressure_command", SETPOINT, TRACKER, *_gauges(scene)},
        reply={*services, *NODE_SERVICES},
        execute=set(actions),
    )
    rig_files = [load_rig(rig) for rig in rigs]
    bridge = Bridge(load_scene(scene), rig_files[0], mode=Mode.MIRROR, clock=time.monotonic)
    permissions.publish |= {name for name, one in bridge.twin.topics.items() if one.direction == "out"}
    # The output process runs in the enclave of its bridge.
    for link in (link for rig in rig_files for link in rig.links):
        if isinstance(link, TopicSettings):
            permissions.subscribe |= {rule.topic for rule in link.receive}
            permissions.publish |= {link.send.topic} if link.send else set()
    return permissions


def mock_rig_permissions(scene: str) -> Permissions:
    """Return what the mock rig does, by any transport."""
    return Permissions(
        "/",
        "mock_rig",
        publish={*NODE_TOPICS, "~/chambers", SETPOINT, TRACKER, *_gauges(scene)},
        subscribe={COMMAND},
        reply=set(NODE_SERVICES),
    )


def policy(scene: str, rigs: Iterable[str]) -> str:
    """Return the policy file."""
    root = ElementTree.Element("policy", version="0.2.0")
    root.append(ElementTree.Comment(EXPLANATION))
    enclaves = ElementTree.SubElement(root, "enclaves")
    for one in (sim_permissions(scene), bridge_permissions(scene, rigs), mock_rig_permissions(scene)):
        profiles = ElementTree.SubElement(
            ElementTree.SubElement(enclaves, "enclave", path=one.enclave), "profiles"
        )
        profile = ElementTree.SubElement(profiles, "profile", ns=one.namespace, node=one.node)
        for group, kind, verb, names in (
            ("topics", "topic", "publish", one.publish),
            ("topics", "topic", "subscribe", one.subscribe),
            ("services", "service", "reply", one.reply),
            ("actions", "action", "execute", one.execute),
        ):
            if names:
                allowed = ElementTree.SubElement(profile, group, {verb: "ALLOW"})
                for name in sorted(names):
                    ElementTree.SubElement(allowed, kind).text = name
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _reports(scene: str) -> set[str]:
    simulation = load_scene(scene).build()
    arms = simulation.arm_names or ("left", "right")
    patterns = [name for name, topic in TOPICS.items() if topic.direction == "out"]
    return {one for name in patterns for one in expand(name, arms if "{arm}" in name else simulation.points)}


def _gauges(scene: str) -> set[str]:
    return {f"/rig/{arm}/pressure" for arm in load_scene(scene).build().arm_names}


def _split(entries: Iterable[ServiceEntry]) -> tuple[list[str], list[str]]:
    actions = [one.name for one in entries if "/action/" in one.type]
    return [one.name for one in entries if one.name not in actions], actions


def main() -> None:
    """Write the policy."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="rig", help="scene whose points and arms are reported")
    parser.add_argument("--rig", action="append", help="rig file of the bridge; may be given again")
    parser.add_argument("-o", "--output", type=Path, default=POLICY)
    arguments = parser.parse_args()
    arguments.output.write_text(policy(arguments.scene, arguments.rig or shipped_rigs()), encoding="utf-8")


if __name__ == "__main__":
    main()

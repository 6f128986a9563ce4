"""Interfaces that the node uses where they are installed, and does without where they are not."""

from __future__ import annotations

import os
import shlex
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rclpy.type_support import check_for_type_support

from ldcs_ros.extras import in_checkout

if TYPE_CHECKING:
    from rclpy.type_support import Msg

OPTIONAL: dict[str, str] = {
    "ldcs_msgs": "arm_command, lattice_state, solver_status, apply_wrench, load_scene, reach",
    "simulation_interfaces": "the standard simulator services",
    "tf2_msgs": "/tf and /tf_static",
    "launch": "the launch files",
}


def build_advice() -> str:
    """Return how this user gets ldcs_msgs; its sources are in the checkout, and in the package of a wheel."""
    if in_checkout() and not os.environ.get("ROS_DISTRO"):
        return "build it with `make msgs`"
    # colcon looks for no package inside another, so a clone in src/ builds ldcs_ros alone.
    sources = ". msg_defs" if in_checkout() else shlex.quote(str(Path(__file__).parents[2] / "msg_defs"))
    build = f"`colcon build --base-paths {sources} && source install/setup.bash`"
    return f"build it with {build}" + ("" if os.environ.get("ROS_DISTRO") else " in a ROS 2 distribution")


# A message of each package of messages: whether its library fits this Python and this ROS shows when it is loaded.
_PROBES = {
    "ldcs_msgs": "ldcs_msgs/msg/LatticeState",
    "simulation_interfaces": "simulation_interfaces/msg/Result",
    "tf2_msgs": "tf2_msgs/msg/TFMessage",
}


_NEWEST_SERVICE = "Reach"
"""What an ldcs_msgs built from an earlier checkout lacks."""


@cache
def import_problem(package: str) -> str:
    """Return why a package cannot be used, in words; '' when it can."""
    spec = find_spec(package)
    # A folder that happens to have the name, such as a package's sources, has no origin.
    if spec is None or spec.origin is None:
        return "not installed"
    try:
        if package in _PROBES:
            check_for_type_support(message_type(_PROBES[package]))
        if package == "ldcs_msgs" and not hasattr(import_module("ldcs_msgs.srv"), _NEWEST_SERVICE):
            return f"older than this package, it has no srv/{_NEWEST_SERVICE}"
    except Exception as error:  # built for another Python or another ROS: it fails in many ways
        return f"cannot be loaded: {' '.join(str(error).split()) or repr(error)}"
    return ""


def installed() -> dict[str, bool]:
    """Return for each optional package whether it can be used."""
    return {name: not import_problem(name) for name in OPTIONAL}


def missing_line() -> str:
    """Return the one line that says what is left out; '' when nothing is."""
    import_problems = {name: import_problem(name) for name in OPTIONAL}
    groups: dict[str, list[str]] = {}
    for name, why in import_problems.items():
        groups.setdefault(why, []).append(f"{name} ({OPTIONAL[name]})")
    line = "; ".join(f"{why}, left out: {', '.join(names)}" for why, names in groups.items() if why)
    return f"{line}; {build_advice()}" if import_problems["ldcs_msgs"] else line


def interface_states(used: set[str]) -> dict[str, str]:
    """Return the state of each optional interface in words, given those that are used."""
    words = {}
    for name, purpose in OPTIONAL.items():
        state = "in use" if name in used else import_problem(name) or "installed, not used"
        words[name] = f"{state} ({purpose})"
    return words


def message_type(name: str) -> type[Msg]:
    """Return the rclpy class of a type such as 'std_msgs/msg/Header'."""
    package, _, kind = name.split("/")
    return getattr(import_module(f"{package}.msg"), kind)

"""The programs of `ros2 run ldcs_ros`; `python -m ldcs_ros.ros PROGRAM` runs the same without an installation.

Each node's module is imported late: rclpy loads slowly, and a signal meanwhile must find its handler.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NoReturn

from ldcs_ros.ros.common.node_process import run
from ldcs_ros.ros.live_view import main as live_view

if TYPE_CHECKING:
    from ldcs_ros.ros.common.node_process import RunnableNode
    from ldcs_ros.ros.common.parameters import NodeParameter


def sim(arguments: list[str] | None = None) -> int:
    """Run the live twin until its duration is over, Ctrl-C or SIGTERM; return the exit status."""

    def load() -> Callable[[], RunnableNode]:
        from ldcs_ros.ros.sim.simulation_node import SimulationNode

        return SimulationNode.started

    def parameters() -> Mapping[str, NodeParameter]:
        from ldcs_ros.ros.sim.parameters import PARAMETERS

        return PARAMETERS

    return run("sim", load, arguments, parameters)


def bridge(arguments: list[str] | None = None) -> NoReturn:
    """Run the bridge to a rig until Ctrl-C or SIGTERM; end the process with the exit status."""

    def load() -> Callable[[], RunnableNode]:
        from ldcs_ros.ros.rig.rig_bridge import RigBridge

        return RigBridge

    def parameters() -> Mapping[str, NodeParameter]:
        from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS

        return BRIDGE_PARAMETERS

    status = run("bridge", load, arguments, parameters)
    # The end of the interpreter waits for a thread in the middle of a long computation; bags and links are closed.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def mock_rig(arguments: list[str] | None = None) -> int:
    """Run the mock rig until Ctrl-C or SIGTERM; return the exit status."""

    def load() -> Callable[[], RunnableNode]:
        from ldcs_ros.ros.rig.mock_rig_node import MockRigNode

        return MockRigNode

    def parameters() -> Mapping[str, NodeParameter]:
        from ldcs_ros.ros.rig.rig_parameters import MOCK_RIG_PARAMETERS

        return MOCK_RIG_PARAMETERS

    return run("mock_rig", load, arguments, parameters)


PROGRAMS: dict[str, Callable[[list[str] | None], int]] = {
    "bridge": bridge,
    "live_view": live_view,
    "mock_rig": mock_rig,
    "sim": sim,
}


def main(words: list[str]) -> int:
    """Run the program that the first word names with the others; return its exit status."""
    if not words or words[0] not in PROGRAMS:
        print(f"ldcs_ros.ros: got {words[:1]}, expected one of {', '.join(PROGRAMS)}", file=sys.stderr)
        return 2
    sys.argv = words  # rclpy reads the arguments of the process
    return PROGRAMS[words[0]](None)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

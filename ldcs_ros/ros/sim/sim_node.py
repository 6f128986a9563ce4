"""`ros2 run ldcs_ros sim`: the live twin as a process."""

from __future__ import annotations

import sys
from collections.abc import Callable

from ldcs_ros.ros.common.node_process import run


def main(arguments: list[str] | None = None) -> int:
    """Run the node until its duration is over, Ctrl-C or SIGTERM; return the exit status."""
    return run("sim", _load, arguments)


def _load() -> Callable[[], object]:
    # rclpy takes a second to load: a signal meanwhile must find its handler.
    from ldcs_ros.ros.sim.simulation_node import SimulationNode

    return SimulationNode.started


if __name__ == "__main__":
    sys.exit(main())

"""`ros2 run ldcs_ros mock_rig`: a stand-in rig for trying the bridge, with faults at the turn of a parameter."""

from __future__ import annotations

import sys
from collections.abc import Callable

from ldcs_ros.ros.common.node_process import run


def main(arguments: list[str] | None = None) -> int:
    """Run the stand-in rig until Ctrl-C or SIGTERM; return the exit status."""
    return run("mock_rig", _load, arguments)


def _load() -> Callable[[], object]:
    # rclpy takes a second to load: a signal meanwhile must find its handler.
    from ldcs_ros.ros.rig.stand_in_rig import StandInRig

    return StandInRig


if __name__ == "__main__":
    sys.exit(main())

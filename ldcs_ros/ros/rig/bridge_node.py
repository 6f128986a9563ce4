"""`ros2 run ldcs_ros bridge`: a rig and its twin side by side; thin, everything that decides is in the bridge room."""

from __future__ import annotations

import sys
from collections.abc import Callable

from ldcs_ros.ros.common.node_process import run


def main(arguments: list[str] | None = None) -> int:
    """Run the bridge until Ctrl-C or SIGTERM; return the exit status."""
    return run("bridge", _load, arguments)


def _load() -> Callable[[], object]:
    # rclpy takes a second to load: a signal meanwhile must find its handler.
    from ldcs_ros.ros.rig.rig_bridge import RigBridge

    return RigBridge


if __name__ == "__main__":
    sys.exit(main())

"""What the standard simulator services ask of the node that offers them."""

from __future__ import annotations

import threading
from typing import Protocol

from ldcs_ros.ros.sim.runner import Runner


class Host(Protocol):
    """The node, without what ROS makes of it."""

    finished: threading.Event
    """Set when the node is to end."""

    @property
    def runner(self) -> Runner | None:
        """The runner; None while the node is unconfigured."""

    def active_runner(self) -> Runner:
        """Return the runner, or raise NotActive."""

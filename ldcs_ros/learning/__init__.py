"""Environments for reinforcement learning by the interface of Gymnasium, a vector of them, and a baseline."""

from __future__ import annotations

from ldcs_ros import extras

# Before the modules that need it: its absence is told with the command that installs it.
extras.load("gymnasium", extra="rl", purpose="ldcs_ros.learning")

from ldcs_ros.learning.baseline import LinearFeedback  # noqa: E402
from ldcs_ros.learning.environment import SurfaceEnv, make_vector  # noqa: E402
from ldcs_ros.learning.tasks import TASKS  # noqa: E402

__all__ = ["TASKS", "LinearFeedback", "SurfaceEnv", "make_vector"]

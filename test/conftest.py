"""Settings of every test run: checked message fields, no network, no display, logs in a folder of the run."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

# For `small_sheet`, the scene of many tests.
sys.path.insert(0, str(Path(__file__).parent))

# Before any test module imports a message package, rclpy or matplotlib; processes under test inherit them.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
# Shared memory only: no socket at all. ROS_AUTOMATIC_DISCOVERY_RANGE would add one, so it must be absent.
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "SHM")
os.environ.pop("ROS_AUTOMATIC_DISCOVERY_RANGE", None)
os.environ.setdefault("ROS_LOG_DIR", os.path.join(tempfile.gettempdir(), f"ldcs_ros_test_log_{os.getuid()}"))

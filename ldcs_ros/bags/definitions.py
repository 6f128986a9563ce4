"""The definitions of our own messages, read from the interface package that ROS builds them from."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

INTERFACE_PACKAGE = "ldcs_msgs"
# A link in a checkout, plain files where the package is installed.
FOLDER = Path(__file__).parents[1] / "msg_defs"


@lru_cache(maxsize=1)
def own_definitions() -> dict[str, str]:
    """Return `ldcs_msgs/msg/Name` -> text of the .msg file, for every message of the interface package."""
    return {
        f"{INTERFACE_PACKAGE}/msg/{path.stem}": path.read_text(encoding="utf-8")
        for path in sorted((FOLDER / "msg").glob("*.msg"))
    }

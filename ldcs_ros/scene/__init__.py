"""Scene files as frozen, checked `Scene` objects."""

from __future__ import annotations

from ldcs_ros.scene.load import load_scene, shipped_scenes
from ldcs_ros.scene.scene import Scene

__all__ = ["Scene", "load_scene", "shipped_scenes"]

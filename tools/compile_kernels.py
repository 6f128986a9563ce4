"""Compile the kernels of all shipped scenes into numba's cache, so that the first run of a user starts at once."""

from __future__ import annotations

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.twin.warm_up import warm_up


def main() -> None:
    """Make a short step of every shipped scene, and of two under commands; each kernel that they need is compiled."""
    for name in shipped_scenes():
        warm_up(load_scene(name), commanded=name in ("paper", "rig"))


if __name__ == "__main__":
    main()

"""Compile the kernels of all shipped scenes into numba's cache, so that the first run of a user starts at once."""

from __future__ import annotations

from ldcs_ros import load_scene, shipped_scenes


def main() -> None:
    """Make a short step of every shipped scene; each kernel that one needs is compiled by it."""
    for name in shipped_scenes():
        load_scene(name).build().advance_to(1e-3)


if __name__ == "__main__":
    main()

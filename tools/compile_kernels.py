"""Compile the kernels of all shipped scenes and of derivatives into numba's cache, so that first runs start at once."""

from __future__ import annotations

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.twin.warm_up import warm_up


def main() -> None:
    """Make a short step of every shipped scene, two of them under commands, one with derivatives."""
    for name in shipped_scenes():
        warm_up(load_scene(name), commanded=name in ("paper", "rig"))
    simulation = load_scene("rig").build()
    # Of a command alone, of a number whose start moves, and backwards: the three kinds of equations.
    simulation.run_sensitivity([0.01], of=["P1"], to=["pressure.left", "effects.payload.mass"])
    simulation.run_gradient([0.01], of=["P1"], weights=[[1.0, 0.0, 0.0]])


if __name__ == "__main__":
    main()

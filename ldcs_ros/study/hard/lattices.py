"""Hard cases of lattices: the smallest, long and thin ones, a fine one, foils and bricks."""

from __future__ import annotations

from ldcs_ros.study.hard.case import HardCase, Reference
from ldcs_ros.study.hard.scenes import ARMS, HANGING, changed

THIN = "a foil of 0.1 mm has no bending stiffness to speak of and hangs straight down: bounds as for 0.1 m of travel"


LATTICE_CASES = (
    *(
        HardCase(f"lattice {nodes}", changed(HANGING, {"lattice.nodes": nodes}), 1.0, Reference(), fast=nodes == [2, 2])
        for nodes in ([2, 2], [2, 33], [33, 2], [65, 9])
    ),
    *(
        HardCase(f"lattice {nodes} with arms", changed(ARMS, {"lattice.nodes": nodes, "effects.arms.width": 0}), 0.5,
            Reference(), fast=nodes == [2, 2])
        for nodes in ([2, 2], [2, 33], [33, 2], [65, 9])
    ),
    HardCase("aspect ratio 1:50", changed(HANGING, {"lattice.size": [0.02, 1.0, 0.01]}), 1.0, Reference()),
    HardCase("aspect ratio 50:1", changed(HANGING, {"lattice.size": [1.0, 0.02, 0.01]}), 1.0, Reference()),
    HardCase("aspect ratio 1:50, lattice [3, 51]", changed(HANGING, {"lattice.size": [0.02, 1.0, 0.01],
        "lattice.nodes": [3, 51]}), 0.5, Reference()),
    HardCase("thickness 1e-4 m", changed(HANGING, {"lattice.size": [0.14, 0.14, 1e-4]}), 1.0, Reference(), THIN),
    HardCase("thickness 1e-4 m with arms", changed(ARMS, {"lattice.size": [0.14, 0.14, 1e-4]}), 1.0, Reference()),
    HardCase("thickness 0.1 m", changed(HANGING, {"lattice.size": [0.14, 0.14, 0.1]}), 1.0, Reference()),
    HardCase("thickness 0.1 m with arms", changed(ARMS, {"lattice.size": [0.14, 0.14, 0.1]}), 1.0, Reference()),
)  # fmt: skip

"""Hard cases of large deformation: wound-up edges, sheets pressed flat, and starts that no sheet should be in."""

from __future__ import annotations

import math

from ldcs_ros.study.hard.case import HardCase, nearest_equilibrium, own_equilibrium
from ldcs_ros.study.hard.scenes import ARC, ARMS, HANGING, STARTS, Content, changed

# The slowest motion of the hanging sheet, a swing with little stretch, decays by half a digit a second.
UNTIL_REST = 30.0
MIRRORED = (
    "springs along their axes have mirrored equilibria beside the scene's own: the sheet must come to rest in the "
    "one in whose basin it fell"
)


def _wound() -> tuple[HardCase, HardCase]:
    kappa = 2.0 * math.pi / 0.14
    driven = changed(ARC, {"effects.driven_edges.curvature": kappa})
    curved = changed(
        {**ARMS, "inputs": []}, {"effects.arms.drive": "curvature", "effects.arms.curvature": kappa}
    )
    return (
        HardCase("edges wound through 360 degrees", driven, 1.0),
        HardCase("arms wound through 360 degrees", curved, 1.0),
    )


def _recovers(start: str, law: str, scene: Content) -> HardCase:
    own = law != "axial" or start in ("ruffled", "two_coincident")
    return HardCase(
        f"started {start.replace('_', ' ')}, {law}",
        changed(scene, {"effects.springs.law": law}),
        duration=UNTIL_REST,
        check=own_equilibrium if own else nearest_equilibrium,
        reason="" if own else MIRRORED,
        start=start,
    )


PRESSED: Content = changed(
    {**HANGING, "effects": [HANGING["effects"][0], HANGING["effects"][2]]},
    add=(
        {"type": "gravity", "acceleration": [0.0, 0.0, -500.0]},
        {"type": "floor", "height": -0.006, "stiffness": 1e5},
    ),
)

SHAPE_CASES = (
    *_wound(),
    HardCase("pressed flat on the floor by 50 g", PRESSED, 0.3),
    *(_recovers(start, "axial", HANGING) for start in STARTS),
    *(_recovers(start, "corotational", HANGING) for start in ("crumpled", "turned_over", "rolled_up")),
    _recovers("in_one_point", "axiswise", HANGING),
    HardCase("arms and sheet crumpled", ARMS, UNTIL_REST, MIRRORED, nearest_equilibrium, start="crumpled"),
    HardCase(
        "arms straight, sheet on a line",
        ARMS,
        UNTIL_REST,
        MIRRORED,
        nearest_equilibrium,
        start="on_line",
    ),
)

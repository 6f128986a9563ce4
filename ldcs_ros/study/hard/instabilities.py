"""Hard cases of motion that amplifies errors: buckling, snap-through, lateral buckling, self-weight collapse."""

from __future__ import annotations

import math

from ldcs_ros.study.hard.case import HardCase
from ldcs_ros.study.hard.extremes import CLAMP, gravity, sheet, springs
from ldcs_ros.study.hard.scenes import Content

STRIP = (0.3, 0.05, 0.02)
# Its own weight along x buckles the strip between 1.5 and 2 m/s^2.
BUCKLING = 3.0
GROWS = "the motion amplifies each error until the strip has buckled"


def _pushes(*profile: tuple[float, float]) -> list[Content]:
    return [
        {"time": time, "wrench": {"frame": "P1_aligned", "force": [0.0, 0.0, force]}}
        for time, force in profile
    ]


def _column(tilt: float) -> HardCase:
    weight = gravity(BUCKLING * math.sin(tilt), -BUCKLING * math.cos(tilt))
    return HardCase(
        f"buckling column, tilt {tilt:g} rad",
        sheet([7, 2], springs(300.0, 1.0), weight, CLAMP, size=STRIP),
        3.0,
        GROWS,
    )


def _snap(name: str, load: float, profile: tuple[tuple[float, float], ...]) -> HardCase:
    compressed = gravity(0.02, -load)
    return HardCase(
        name,
        sheet(
            [7, 2],
            springs(300.0, 1.0),
            compressed,
            CLAMP,
            {"type": "wrench"},
            size=STRIP,
            inputs=_pushes(*profile),
        ),
        3.0,
        GROWS,
    )


INSTABILITY_CASES = (
    *(_column(tilt) for tilt in (1e-1, 1e-3, 1e-6, 0.0)),
    _snap("snap-through of a compressed strip", 3.0, ((0.0, 0.05), (1.5, -0.25), (1.8, 0.0))),
    _snap("snap-through by a slow push", 2.5, tuple((0.1 * k, 0.05 - 0.01 * k) for k in range(30))),
    HardCase(
        "lateral buckling of a deep strip",
        sheet(
            [7, 3],
            springs(300.0, 1.0),
            gravity(0.002, 0.0, -9.81),
            CLAMP,
            {"type": "force", "at": "P1", "value": [0.0, -0.5, 1e-4]},
            size=(0.3, 0.06, 0.005),
        ),
        1.5,
        "a strip on its edge leaves its plane under a load within it",
    ),
    HardCase(
        "self-weight collapse of a standing sheet",
        sheet([5, 4], springs(60.0, 0.5), gravity(1e-3, -9.81), CLAMP, size=(0.3, 0.1, 0.008)),
        1.0,
        GROWS,
    ),
    HardCase(
        "self-weight collapse onto a floor",
        sheet(
            [4, 3],
            springs(40.0, 0.5),
            gravity(-9.81, -3.0),
            CLAMP,
            {"type": "floor", "height": -0.03, "stiffness": 2000.0},
            size=(0.2, 0.1, 0.008),
        ),
        1.0,
        "folds fall onto a floor",
    ),
    HardCase(
        "inverted start of a strip that must turn over",
        sheet([5, 2], springs(300.0, 1.0), gravity(9.81, 0.01), CLAMP, size=STRIP),
        1.5,
        spin=(0.0, 3.0, 0.0),
    ),
)

"""Hard cases of other surfaces: many arms, holes, regions, a material; shipped and drawn scenes, violent events."""

from __future__ import annotations

from ldcs_ros.study.accuracy.random_scenes import Case, random_case
from ldcs_ros.study.accuracy.shipped_cases import shipped_cases
from ldcs_ros.study.accuracy.violent_cases import violent_cases
from ldcs_ros.study.hard.case import HardCase
from ldcs_ros.study.hard.extremes import CLAMP, arms, gravity, sheet, springs
from ldcs_ros.study.hard.scenes import Content

PUSHED = [{"time": 0.0, "pressure": 80e3}, {"time": 0.25, "pressure": 0.0}]
DRAWN = range(8)
# Processor time of a shipped scene's reference [s].
SHIPPED_SECONDS = 60.0


def _shipped(case: Case) -> HardCase:
    return HardCase(
        case.name.replace("_", " ", 1), case.content, case.duration, reference_seconds=SHIPPED_SECONDS
    )


def _holed(name: str, holes: list[Content], *effects: Content) -> HardCase:
    scene = sheet([7, 7], springs(300.0, 1.0), gravity(), *effects)
    scene["lattice"]["holes"], scene["points"] = holes, {"P1": ["mid", "free_edge"]}
    return HardCase(name, scene, 0.3)


def _region(name: str, region: Content, *effects: Content, inputs: list[Content] | None = None) -> HardCase:
    scene = sheet([5, 4], springs(300.0, 1.0), gravity(), *effects, inputs=inputs)
    scene["lattice"]["regions"] = [region]
    return HardCase(name, scene, 0.3)


def _case(case: Case, *, name: str) -> HardCase:
    return HardCase(
        name,
        case.content,
        case.duration,
        spin=case.spin,
        drift=case.drift,
    )


HALF = {"box": [0.07, -0.07, 0.14, 0.07]}
SURFACE_CASES = (
    HardCase(
        "sixteen arms side by side",
        sheet(
            [5, 5],
            springs(300.0, 1.0),
            CLAMP,
            arms(
                drive="pressure",
                pressure_gain=2e-7,
                arms=[
                    {"name": f"a{k}", "from": [0.0, -0.07 + 0.14 * k / 15], "to": [0.14, -0.07 + 0.14 * k / 15]}
                    for k in range(16)
                ],
            ),
            inputs=PUSHED,
        ),
        0.4,
    ),
    HardCase(
        "a slanted arm that nothing else holds",
        sheet(
            [5, 5],
            springs(300.0, 1.0),
            gravity(),
            arms(drive="pressure", arms=[{"name": "a", "from": [0.01, -0.06], "to": [0.13, 0.05]}]),
            inputs=PUSHED,
        ),
        0.4,
    ),
    _holed("a hole in the middle", [{"circle": [0.07, 0.0, 0.03]}], CLAMP),
    _holed("a bridge of one cell between two holes",
        [{"box": [0.05, 0.03, 0.10, 0.08]}, {"box": [0.05, -0.08, 0.10, -0.012]}], CLAMP),
    _holed("a hole in a sheet that nothing holds", [{"circle": [0.07, 0.0, 0.03]}], {"type": "floor", "height": -0.03}),
    _holed("a hole beside a driven edge", [{"circle": [0.07, 0.0, 0.02]}],
        {"type": "driven_edges", "curvature": 8.0, "rise_time": 1e-3}),
    _region("half of the sheet 1000 times as stiff", {**HALF, "stiffness": 1000.0}, CLAMP),
    _region("half of the sheet a thousandth as stiff", {**HALF, "stiffness": 1e-3}, CLAMP),
    _region("half of the sheet 1000 times as heavy", {**HALF, "mass": 1000.0}, CLAMP),
    _region("half of the sheet without damping", {**HALF, "damping": 1e-6}, CLAMP, arms(),
        inputs=[{"time": 0.0, "torque": 0.03}]),
    HardCase(
        "a lattice of 5 x 5 with Poisson's ratio 0.5",
        {
            "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [5, 5]},
            "material": {"youngs_modulus": 75e3, "poisson": 0.5, "density": 816.0},
            "effects": [{"type": "springs"}, gravity(), CLAMP],
        },
        0.5,
    ),
)  # fmt: skip

SHIPPED_CASES = tuple(_shipped(case) for case in shipped_cases())
DRAWN_CASES = tuple(_case(random_case(seed), name=f"random scene {seed}") for seed in DRAWN)
VIOLENT_CASES = tuple(_case(case, name=case.name.replace("_", " ")) for case in violent_cases())

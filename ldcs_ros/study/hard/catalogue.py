"""The catalogue: every hard case, by chapter; contact, forced steps, long runs and lattices are here."""

from __future__ import annotations

from typing import Any

from ldcs_ros.study.hard.case import HardCase, repetition
from ldcs_ros.study.hard.extremes import EXTREME_CASES
from ldcs_ros.study.hard.instabilities import INSTABILITY_CASES
from ldcs_ros.study.hard.loads import LOAD_CASES
from ldcs_ros.study.hard.scenes import ARC, ARMS, FALLING, HANGING, RIG, Content, changed
from ldcs_ros.study.hard.shapes import SHAPE_CASES
from ldcs_ros.study.hard.stiffness import STIFFNESS_CASES
from ldcs_ros.study.hard.surfaces import DRAWN_CASES, SHIPPED_CASES, SURFACE_CASES, VIOLENT_CASES

LITTLE = (
    "a sheet that sinks in by a tenth of a millimetre moves micro-joules: a fraction of them is no measure"
)
# At rest no node moves. Any: keyword arguments of several types.
AT_REST: dict[str, Any] = {"check": repetition, "sample_from": 10.0}
CHATTER = [{"time": k * 0.05, "pressure": 60e3 * (k % 2)} for k in range(8)]
LYING = changed(FALLING, {"effects.floor.height": -0.005})

CONTACT_CASES = (
    HardCase("plates under chattering pressure", changed(RIG, {"inputs": CHATTER}), 0.4),
    HardCase(
        "stiff plates under chattering pressure",
        changed(RIG, {"inputs": CHATTER, "effects.support.stiffness": 1e6, "effects.support.onset": 1e-6}),
        duration=0.4,
    ),
    HardCase("dropped on the floor from 0.2 m", FALLING, 0.4),
    HardCase(
        "dropped on a hard floor without damping",
        changed(FALLING, {"effects.floor.stiffness": 1e6, "effects.floor.damping": 0.0, "effects.floor.onset": 1e-6}),
        duration=0.3,
    ),
    HardCase(
        "dropped crumpled",
        FALLING,
        duration=0.4,
        start="crumpled",
    ),
    HardCase("lying on the floor for 60 s", LYING, 60.0, LITTLE, **AT_REST),
    HardCase(
        "lying on a hard floor for 60 s",
        changed(LYING, {"effects.floor.stiffness": 1e6, "effects.floor.onset": 1e-6}),
        duration=60.0,
        reason=LITTLE,
        **AT_REST,
    ),
    HardCase(
        "resting on the plates for 60 s", changed(RIG, {"inputs": []}), 60.0, LITTLE, **AT_REST
    ),
)  # fmt: skip


def _forced(name: str, scene: Content, method: str, dt: float) -> HardCase:
    # A microsecond over a millisecond, a tenth of a second over half a second.
    duration = min(0.5, 1000 * dt)
    values = {"solver": {"integrator": method, "dt": dt}}
    return HardCase(
        f"{name}: {method}, dt = {dt:g} s",
        changed(scene, values),
        duration,
        reach=0.3,
    )


STEP_CASES = (
    *(
        _forced(name, scene, method, dt)
        for name, scene in (("arc", ARC), ("arms", ARMS))
        for method in ("esdirk43", "trbdf2")
        for dt in (1e-6, 1e-3, 1e-1)
    ),
    *(
        HardCase(
            f"arc: {method}, dt = 0.001 s",
            changed(ARC, {"solver": {"integrator": method, "dt": 1e-3}}),
            duration=0.1,
            refusal=rf"dt = 0.001 s is above the stability limit \S+ s of {method}",
        )
        for method in ("semi_implicit_euler", "rk4")
    ),
)

THIN = (
    "a foil of 0.1 mm has negligible bending stiffness and hangs straight down: bounds as for 0.1 m of travel"
)


LATTICE_CASES = (
    *(
        HardCase(f"lattice {nodes}", changed(HANGING, {"lattice.nodes": nodes}), 0.5)
        for nodes in ([2, 2], [2, 17], [17, 2])
    ),
    *(
        HardCase(f"lattice {nodes} with arms", changed(ARMS, {"lattice.nodes": nodes, "effects.arms.width": 0}), 0.3)
        for nodes in ([2, 2], [2, 17], [17, 2])
    ),
    HardCase("aspect ratio 1:50", changed(HANGING, {"lattice.size": [0.02, 1.0, 0.01]}), 0.5),
    HardCase("aspect ratio 50:1", changed(HANGING, {"lattice.size": [1.0, 0.02, 0.01]}), 0.5),
    HardCase("thickness 1e-4 m", changed(HANGING, {"lattice.size": [0.14, 0.14, 1e-4]}), 0.5, THIN),
    HardCase("thickness 1e-4 m with arms", changed(ARMS, {"lattice.size": [0.14, 0.14, 1e-4]}), 0.3),
    HardCase("thickness 0.1 m", changed(HANGING, {"lattice.size": [0.14, 0.14, 0.1]}), 0.5),
)  # fmt: skip

CHAPTERS: dict[str, tuple[HardCase, ...]] = {
    "Stiffness and damping": STIFFNESS_CASES,
    "Loads": LOAD_CASES,
    "Shapes": SHAPE_CASES,
    "Contact": CONTACT_CASES,
    "Forced steps and long runs": STEP_CASES,
    "Lattices": LATTICE_CASES,
    "Ends of the schema": EXTREME_CASES,
    "Instabilities": INSTABILITY_CASES,
    "Other surfaces": SURFACE_CASES,
    "Violent events": VIOLENT_CASES,
    "Random scenes": DRAWN_CASES,
    "Shipped scenes": SHIPPED_CASES,
}
CASES: dict[str, HardCase] = {case.name: case for cases in CHAPTERS.values() for case in cases}

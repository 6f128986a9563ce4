"""Hard cases of stiffness and damping: scaled over six decades, stiff couplings, none, and far excessive damping."""

from __future__ import annotations

from ldcs_ros.study.hard.case import HardCase, nothing
from ldcs_ros.study.hard.scenes import ARC, ARMS, HANGING, changed

COARSE = (
    "the elastic motion is a few times the asked accuracy: as a fraction of this small energy the residual is larger, "
    "and falls with the accuracy"
)
SCALES = (1e-3, 1e3)
STIFFNESS, DAMPING = 80.0, 5.0
DRIFT = (
    "a sheet without damping swings chaotically and has no reference: it must stay in reach and keep its energy; "
    "the audit is the drift. With a fixed step it is the method's own, and first-order methods may lose all of it"
)
LITTLE_MOTION = (("arc", 1e3, 1e3), ("arc", 1e-3, 1e3))


def _scaled() -> list[HardCase]:
    cases = []
    for name, scene in (("arc", ARC), ("arms", ARMS)):
        for k in SCALES:
            for c in SCALES:
                values = {
                    "effects.springs.stiffness": k * STIFFNESS,
                    "effects.springs.damping": c * DAMPING,
                }
                cases.append(
                    HardCase(
                        f"{name}: stiffness x {k:g}, damping x {c:g}",
                        changed(scene, values),
                        duration=0.05 if (k, c) == (1e3, 1e-3) else 0.5,
                        reason=COARSE if (name, k, c) in LITTLE_MOTION else "",
                    )
                )
    return cases


def _couplings() -> list[HardCase]:
    cases = []
    for words, damping in (("", 1e6 * DAMPING), (", undamped", 0.0)):
        values = {
            "effects.arms.coupling_stiffness": 1e6 * STIFFNESS,
            "effects.arms.coupling_damping": damping,
            "lattice.nodes": [3, 3],
        }
        name = f"coupling 1e+06 times as stiff as the sheet{words}"
        cases.append(HardCase(name, changed(ARMS, values), 0.3))
    return cases


def _undamped() -> list[HardCase]:
    cases = []
    for method in ("esdirk43", "rk4", "semi_implicit_euler"):
        values = {
            "effects.springs.damping": 0.0,
            "lattice.nodes": [3, 3],
            "solver": {"integrator": method, "dt": 2e-3},
        }
        name = f"no damping for 10 s, dt = 0.002 s, {method}"
        cases.append(HardCase(name, changed(HANGING, values), 10.0, DRIFT, check=nothing, reach=0.3))
    values = {"effects.springs.damping": 0.0, "effects.gravity.acceleration": [0.0, 0.0, -0.5]}
    cases.append(HardCase("no damping, small swing for 1 s", changed(HANGING, values), 1.0))
    return cases


STIFFNESS_CASES = (
    *_scaled(),
    *_couplings(),
    *_undamped(),
    HardCase(
        "so much damping that it creeps",
        changed(ARMS, {"effects.springs.damping": 1e6, "effects.arms.coupling_damping": 1e6}),
        duration=60.0,
    ),
    HardCase(
        "damping a million times, stiffness a millionth",
        changed(HANGING, {"effects.springs.damping": 5e6, "effects.springs.stiffness": 8e-5}),
        duration=10.0,
    ),
    *(
        HardCase(
            f"{law}: stiffness x 1000, damping x 0.001",
            changed(
                HANGING,
                {
                    "effects.springs.law": law,
                    "effects.springs.stiffness": 8e4,
                    "effects.springs.damping": 5e-3,
                },
            ),
            duration=0.05,
            reason=COARSE if law == "axiswise" else "",
        )
        for law in ("axiswise", "corotational")
    ),
)

"""Hard cases of stiffness and damping: scaled over six decades, stiff couplings, none, and far excessive damping."""

from __future__ import annotations

from ldcs_ros.study.hard.case import HardCase, nothing
from ldcs_ros.study.hard.scenes import ARC, ARMS, HANGING, changed

COARSE = (
    "the elastic motion is a few times the asked accuracy: as a fraction of this small energy the residual is larger, "
    "and falls with the accuracy"
)
SCALES = (1e-3, 1.0, 1e3)
STIFFNESS, DAMPING = 80.0, 5.0
DRIFT = (
    "a sheet without damping swings chaotically and has no reference: it must stay in reach and keep its energy; "
    "the audit is the drift. With a fixed step it is the method's own, and first-order methods may lose all of it"
)
LITTLE_MOTION = (("arms", 1e3, 1.0), ("arc", 1.0, 1e3), ("arc", 1e3, 1e3), ("arc", 1e-3, 1e3))


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
                        duration=0.3 if (k, c) == (1e3, 1e-3) else 1.0,
                        reason=COARSE if (name, k, c) in LITTLE_MOTION else "",
                        fast=(k, c) in ((1.0, 1e3), (1e3, 1.0), (1e-3, 1e-3)),
                    )
                )
    return cases


def _couplings() -> list[HardCase]:
    cases = []
    for ratio in (1e2, 1e4, 1e6):
        values = {
            "effects.arms.coupling_stiffness": ratio * STIFFNESS,
            "effects.arms.coupling_damping": ratio * DAMPING,
        }
        cases.append(
            HardCase(
                f"coupling {ratio:g} times as stiff as the sheet",
                changed(ARMS, values),
                duration=1.5,
                fast=ratio == 1e6,
            )
        )
        values = {**values, "effects.arms.coupling_damping": 0.0}
        cases.append(
            HardCase(
                f"coupling {ratio:g} times as stiff as the sheet, undamped",
                changed(ARMS, values),
                duration=1.0,
            )
        )
    return cases


def _undamped() -> list[HardCase]:
    cases = []
    for nodes, method, solver in (
        (5, "esdirk43", {"accuracy": 1e-4}),
        (3, "esdirk43", {"dt": 2e-3}),
        (3, "trbdf2", {"dt": 2e-3}),
        (3, "rosenbrock_w", {"dt": 2e-3}),
        (3, "rk4", {"dt": 2e-3}),
        (3, "semi_implicit_euler", {"dt": 2e-3}),
        (3, "linearly_implicit_euler", {"dt": 2e-3}),
    ):
        values = {
            "effects.springs.damping": 0.0,
            "lattice.nodes": [nodes, nodes],
            "solver": {"integrator": method, **solver},
        }
        cases.append(
            HardCase(
                f"no damping for 60 s, [{nodes}, {nodes}], {method}",
                changed(HANGING, values),
                duration=60.0,
                check=nothing,
                reach=0.3,
                reason=DRIFT,
                slow=nodes == 5,
                timeout=400.0,
            )
        )
    values = {"effects.springs.damping": 0.0, "effects.gravity.acceleration": [0.0, 0.0, -0.5]}
    cases.append(
        HardCase(
            "no damping, small swing for 2 s",
            changed(HANGING, values),
            duration=2.0,
        )
    )
    return cases


STIFFNESS_CASES = (
    *_scaled(),
    *_couplings(),
    *_undamped(),
    HardCase(
        "so much damping that it creeps",
        changed(ARMS, {"effects.springs.damping": 1e6, "effects.arms.coupling_damping": 1e6}),
        duration=60.0,
        fast=True,
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
            duration=0.2,
            reason=COARSE if law == "axiswise" else "",
            slow=law == "corotational",
        )
        for law in ("axiswise", "corotational")
    ),
)

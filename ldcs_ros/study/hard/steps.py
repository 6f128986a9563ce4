"""Hard cases of forced steps and of long runs: fixed steps over five decades, an hour of slow cycles."""

from __future__ import annotations

from ldcs_ros.study.hard.case import Bounded, HardCase, Periodic, Refused
from ldcs_ros.study.hard.scenes import ARC, ARMS, Content, changed

PERIOD = 20.0  # s


def _forced(name: str, scene: Content, method: str, dt: float) -> HardCase:
    # A microsecond over a millisecond, a tenth of a second over three seconds.
    duration = min(3.0, 1000 * dt)
    values = {"solver": {"integrator": method, "dt": dt}}
    return HardCase(
        f"{name}: {method}, dt = {dt:g} s",
        changed(scene, values),
        duration,
        Bounded(0.3, reference="esdirk43"),
        fast=dt == 0.1,
    )


def _cycles(count: int) -> list[Content]:
    return [{"time": 0.5 * PERIOD * k, "torque": 0.1392 * (1 - k % 2)} for k in range(2 * count)]


STEP_CASES = (
    *(
        _forced(name, scene, method, dt)
        for name, scene in (("arc", ARC), ("arms", ARMS))
        for method in ("esdirk43", "trbdf2")
        for dt in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    ),
    *(
        HardCase(
            f"arc: {method}, dt = 0.001 s",
            changed(ARC, {"solver": {"integrator": method, "dt": 1e-3}}),
            duration=0.1,
            right=Refused(rf"dt = 0.001 s is above the stability limit \S+ s of {method}"),
            fast=True,
        )
        for method in ("semi_implicit_euler", "rk4")
    ),
    HardCase(
        "one hour of slow cycles",
        changed(ARMS, {"inputs": _cycles(180)}),
        duration=180 * PERIOD,
        # Two cycles may differ by what two iterations may leave over: 2 x 0.02 x 0.15 of the asked 1e-5 m.
        right=Periodic(PERIOD, after=3 * PERIOD, limit=6e-8),
        audit=float("inf"),
        patience=600.0,
        reason="work and dissipation of an hour exceed the energy stored a thousandfold; the residual is a sum of "
        "their errors, the cycles themselves are compared instead",
    ),
)

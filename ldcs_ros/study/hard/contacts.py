"""Hard cases of contact that comes and goes: chattering plates, a drop, a long rest."""

from __future__ import annotations

from math import inf

from ldcs_ros.study.hard.case import HardCase, Reference, Still
from ldcs_ros.study.hard.scenes import FALLING, RIG, changed

LITTLE = "a sheet that sinks in by a tenth of a millimetre moves micro-joules: a share of them says nothing"
CHATTER = [{"time": k * 0.05, "pressure": 60e3 * (k % 2)} for k in range(40)]
LYING = changed(FALLING, {"effects.floor.height": -0.005})

CONTACT_CASES = (
    HardCase("plates under chattering pressure", changed(RIG, {"inputs": CHATTER}), 2.0, Reference(), fast=True),
    HardCase(
        "stiff plates under chattering pressure",
        changed(RIG, {"inputs": CHATTER, "effects.support.stiffness": 1e6, "effects.support.onset": 1e-6}),
        duration=2.0,
        right=Reference(),
    ),
    HardCase("dropped on the floor from 0.2 m", FALLING, 1.0, Reference(), fast=True),
    HardCase(
        "dropped on a hard floor without damping",
        changed(FALLING, {"effects.floor.stiffness": 1e6, "effects.floor.damping": 0.0, "effects.floor.onset": 1e-6}),
        duration=0.5,
        right=Reference(),
    ),
    HardCase(
        "dropped crumpled",
        FALLING,
        duration=0.6,
        right=Reference(),
        start="crumpled",
    ),
    HardCase("lying on the floor for 60 s", LYING, 60.0, Still(10.0, 1e-6), LITTLE, audit=inf, fast=True),
    HardCase(
        "lying on a hard floor for 60 s",
        changed(LYING, {"effects.floor.stiffness": 1e6, "effects.floor.onset": 1e-6}),
        duration=60.0,
        right=Still(10.0, 1e-6),
        reason=LITTLE,
        audit=inf,
    ),
    HardCase(
        "resting on the plates for 60 s", changed(RIG, {"inputs": []}), 60.0, Still(10.0, 1e-6), LITTLE, audit=inf
    ),
)  # fmt: skip

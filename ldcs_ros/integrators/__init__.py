"""One method a file; base.py holds their contract, control.py chooses their steps."""

from __future__ import annotations

import importlib

from ldcs_ros.integrators.base import Integrator

INTEGRATORS: dict[str, str] = {
    "esdirk43": "ldcs_ros.integrators.esdirk43:Esdirk43",
    "bdf2": "ldcs_ros.integrators.bdf2:Bdf2",
    "trbdf2": "ldcs_ros.integrators.trbdf2:TrBdf2",
    "rosenbrock_w": "ldcs_ros.integrators.rosenbrock_w:RosenbrockW",
    "linearly_implicit_euler": "ldcs_ros.integrators.linearly_implicit_euler:LinearlyImplicitEuler",
    "rkc2": "ldcs_ros.integrators.rkc2:Rkc2",
    "rk4": "ldcs_ros.integrators.rk4:Rk4",
    "semi_implicit_euler": "ldcs_ros.integrators.semi_implicit_euler:SemiImplicitEuler",
    "exponential": "ldcs_ros.integrators.exponential:Exponential",
    "radau": "ldcs_ros.integrators.radau:Radau",
}


# Taken by `integrator: auto`, but for steps between commands at a rate.
DEFAULT_INTEGRATOR = "esdirk43"


def integrator_class(name: str) -> type[Integrator]:
    """Import and return a method by its name in `INTEGRATORS`."""
    module, _, attribute = INTEGRATORS[name].partition(":")
    loaded: type[Integrator] = getattr(importlib.import_module(module), attribute)
    return loaded

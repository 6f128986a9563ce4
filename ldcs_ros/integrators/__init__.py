"""One method a file; base.py holds their contract, control.py chooses their steps."""

from __future__ import annotations

import importlib

from ldcs_ros.integrators.base import Integrator

INTEGRATORS: dict[str, str] = {
    "esdirk43": "ldcs_ros.integrators.esdirk43:Esdirk43",
    "trbdf2": "ldcs_ros.integrators.trbdf2:TrBdf2",
}


def integrator_class(name: str) -> type[Integrator]:
    """Import and return a method by its name in `INTEGRATORS`."""
    module, _, attribute = INTEGRATORS[name].partition(":")
    loaded: type[Integrator] = getattr(importlib.import_module(module), attribute)
    return loaded

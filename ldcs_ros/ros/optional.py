"""Interfaces that the node uses where they are installed, and does without where they are not."""

from __future__ import annotations

from importlib.util import find_spec

OPTIONAL: dict[str, str] = {
    "ldcs_msgs": "arm_command, lattice_state, solver_status, apply_wrench, load_scene",
    "simulation_interfaces": "the standard simulator services",
    "tf2_msgs": "/tf and /tf_static",
    "launch": "the launch files",
}


def installed() -> dict[str, bool]:
    """Return for each optional package whether it can be imported."""
    # A folder that happens to have the name, such as a package's sources, has no origin.
    specs = {name: find_spec(name) for name in OPTIONAL}
    return {name: spec is not None and spec.origin is not None for name, spec in specs.items()}


def missing_line(present: dict[str, bool]) -> str:
    """Return the one line that says what is left out; '' when nothing is."""
    missing = [f"{name} ({OPTIONAL[name]})" for name, there in present.items() if not there]
    return f"not installed, left out: {', '.join(missing)}" if missing else ""

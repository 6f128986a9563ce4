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
    return {name: find_spec(name) is not None for name in OPTIONAL}


def missing_line(present: dict[str, bool]) -> str:
    """Return the one line that says what is left out; '' when nothing is."""
    missing = [f"{name} ({OPTIONAL[name]})" for name, there in present.items() if not there]
    return f"not installed, left out: {', '.join(missing)}" if missing else ""

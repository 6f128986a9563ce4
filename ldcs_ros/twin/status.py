"""The health of a twin: its solver, its commands and its watchdog as entries of the diagnostics."""

from __future__ import annotations

from collections.abc import Mapping

from ldcs_ros.messages.diagnostics import OK, WARN, Status
from ldcs_ros.twin.commands import Commands
from ldcs_ros.twin.watchdog import Watchdog

_UNITS = {"wall_time": "s", "error_estimate": "m", "velocity_estimate": "m/s"}


def _with_unit(name: str) -> str:
    return f"{name} [{_UNITS[name]}]" if name in _UNITS else name


def twin_statuses(solver: Mapping[str, object], commands: Commands, watchdog: Watchdog) -> list[Status]:
    """Return the entries that every twin has; `solver` holds the figures of its statistics by name."""
    counts = {f"accepted, {topic}": count for topic, count in sorted(commands.accepted.items())}
    counts |= {f"refused, {reason}": count for reason, count in sorted(commands.refused.items())}
    accepted, refused = sum(commands.accepted.values()), sum(commands.refused.values())
    limits = {"command_timeout [s]": watchdog.timeout, "wrench_timeout [s]": watchdog.wrench_timeout}
    watching = "tripped: arms vented, call rearm" if watchdog.tripped else watchdog.state
    return [
        Status("solver", OK, "running", {_with_unit(name): value for name, value in solver.items()}),
        Status(
            "commands",
            OK,
            commands.last_refusal or "none refused",
            {"accepted": accepted, "refused": refused, **counts},
        ),
        Status("watchdog", WARN if watchdog.tripped else OK, watching, {**limits, "trips": watchdog.trips}),
    ]

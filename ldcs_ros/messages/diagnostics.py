"""Health of the twin as data, and as DiagnosticArray."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.twin.commands import Commands
from ldcs_ros.twin.watchdog import Watchdog

OK, WARN, ERROR = 0, 1, 2


@dataclass(frozen=True)
class Status:
    """One entry of the diagnostics.

    Attributes:
        name: What it is about, one or two words.
        level: OK, WARN or ERROR.
        message: The state in a few words.
        values: Numbers and words by name, unit in the name.
    """

    name: str
    level: int
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


def diagnostic_array(time_ns: int, owner: str, statuses: Iterable[Status]) -> bytes:
    """Return a DiagnosticArray; `owner` (a node's full name) stands before each name."""
    key_value = message_class("diagnostic_msgs/msg/KeyValue")
    status_message = message_class("diagnostic_msgs/msg/DiagnosticStatus")
    array = message_class("diagnostic_msgs/msg/DiagnosticArray")
    entries = [
        status_message(
            level=status.level,
            name=f"{owner}: {status.name}",
            message=status.message,
            hardware_id="ldcs",
            values=[key_value(key=key, value=_text(value)) for key, value in status.values.items()],
        )
        for status in statuses
    ]
    return encode(array(header=header(time_ns, ""), status=entries))


def twin_statuses(solver: Mapping[str, object], commands: Commands, watchdog: Watchdog) -> list[Status]:
    """Return the entries that every twin has; `solver` holds the figures of its statistics by name."""
    counts = {f"accepted, {topic}": count for topic, count in sorted(commands.accepted.items())}
    counts |= {f"refused, {reason}": count for reason, count in sorted(commands.refused.items())}
    accepted, refused = sum(commands.accepted.values()), sum(commands.refused.values())
    limits = {"command_timeout [s]": watchdog.timeout, "wrench_timeout [s]": watchdog.wrench_timeout}
    watching = "tripped: arms vented, call rearm" if watchdog.tripped else watchdog.state
    return [
        Status("solver", OK, "running", solver),
        Status(
            "commands",
            OK,
            commands.last_refusal or "none refused",
            {"accepted": accepted, "refused": refused, **counts},
        ),
        Status("watchdog", WARN if watchdog.tripped else OK, watching, {**limits, "trips": watchdog.trips}),
    ]


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)

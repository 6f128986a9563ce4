"""Health of the twin as data, and as DiagnosticArray."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ldcs_ros.messages.cdr import encode, header, message_class

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


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)

"""A topic of a bag before its first message: message type and quality of service."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import yaml

from ldcs_ros.errors import RecordingError

_INFINITE = {"sec": 9223372036, "nsec": 854775807}
_WORDS = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
}


@dataclass(frozen=True)
class Qos:
    """Quality of service that a publisher offers, in the words that rosbag2 stores.

    Attributes:
        reliability: `reliable` or `best_effort`.
        durability: `volatile` or `transient_local`.
        history: `keep_last` or `keep_all`.
        depth: Messages kept for a slow reader when history is `keep_last`.

    Raises:
        RecordingError: A word that rosbag2 does not know.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    def __post_init__(self) -> None:
        for name, words in _WORDS.items():
            if getattr(self, name) not in words:
                raise RecordingError(
                    f"unknown {name} {getattr(self, name)!r} in a topic's quality of service; "
                    f"expected one of {list(words)}"
                )

    def as_dict(self) -> dict[str, Any]:
        """Return the nine fields of bag version 9; no deadline, no lifespan, no liveliness lease."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


_LONGEST_PROFILES = 100_000


def parse_qos(text: str) -> Qos:
    """Return the first profile of `offered_qos_profiles`; the default where the text is none.

    Words and the numbers that rosbag2 wrote until version 8 mean the same.
    """
    if len(text) > _LONGEST_PROFILES:
        return Qos()
    try:
        profile = yaml.load(text, Loader=yaml.BaseLoader)[0]
        words = {name: _word(profile[name], known) for name, known in _WORDS.items()}
        return Qos(**words, depth=int(profile["depth"][:10]))
    except (yaml.YAMLError, ValueError, LookupError, TypeError, RecursionError, RecordingError):
        return Qos()


def _word(text: str, known: tuple[str, ...]) -> str:
    return known[int(text)] if text.isdecimal() else text


@dataclass(frozen=True)
class TopicInfo:
    """A topic's message type (`package/msg/Name`) and the quality of service that its publisher offers."""

    type: str
    qos: Qos = field(default_factory=Qos)

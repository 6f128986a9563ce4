"""Log lines of the nodes, and a log that limits how often it repeats a line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Protocol

PERIOD = 2.0
"""Shortest time between two lines on one kind of refusal [s]."""

ALARM_PERIOD = 10.0
"""Time between two lines on one lasting alarm [s]."""


class Logger(Protocol):
    """A ROS logger."""

    def info(self, message: str) -> object:
        """Log a message."""

    def warning(self, message: str) -> object:
        """Log a warning."""

    def error(self, message: str) -> object:
        """Log an error."""


class ThrottledLog:
    """A log for the operator: each trip as an ERROR, each kind of refusal as a WARN at most every PERIOD.

    Args:
        logger: Logger of the node.
        clock: Steady clock [s].
    """

    def __init__(self, logger: Logger, clock: Callable[[], float]) -> None:
        self._logger, self._clock = logger, clock
        self._trips = 0
        self._alarmed_at: float | None = None
        self._logged: Counter[str] = Counter()
        self._logged_at: dict[str, float] = {}

    def trip(self, reason: str, count: int) -> None:
        """Log the latest trip, unless it was logged: its reason, and the number of trips so far."""
        if count > self._trips:
            self._trips = count
            self._logger.error(f"vented: {reason}; call arm after the repair")

    def alarm(self, words: str) -> None:
        """Log a lasting alarm when it begins and then every ALARM_PERIOD; '' for none."""
        now = self._clock()
        if not words:
            self._alarmed_at = None
        elif self._alarmed_at is None or now - self._alarmed_at >= ALARM_PERIOD:
            self._alarmed_at = now
            self._logger.error(words)

    def refusals(self, refused: Counter[str], last: str) -> None:
        """Log the refusals since the last line: counts by kind, and the latest refusal in words."""
        now = self._clock()
        for kind, count in refused.items():
            new = count - self._logged[kind]
            if new and now - self._logged_at.get(kind, -PERIOD) >= PERIOD:
                self._logged[kind], self._logged_at[kind] = count, now
                detail = last if last.startswith(f"{kind}: ") else kind
                self._logger.warning(f"{new} command{'s' * (new > 1)} refused, {detail}")

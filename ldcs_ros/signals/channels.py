"""The messages of a rig's topic: decoded, sorted, without copies, and with a count of each irregularity."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import MappingError, RecordingError
from ldcs_ros.signals import fields

# Stamps that are further than this from the recorder's time are of another clock [ns].
_ANOTHER_CLOCK = 1_000_000_000


@dataclass(frozen=True)
class DecodedMessage:
    """A sound message.

    Attributes:
        time: Time at which it acts, on the recorder's clock [ns].
        message: The message object.
    """

    time: int
    message: object


@dataclass
class ChannelReport:
    """The messages of one mapped topic.

    Attributes:
        topic: Its name.
        messages: Messages in the bag.
        malformed: Messages that cannot be read as the mapping demands.
        duplicates: Repeated messages; one is taken.
        out_of_order: Messages with a stamp before that of an earlier one; sorted.
        late: Messages recorded long after their stamp.
        missing: Missing messages, estimated from the silences; the last value is held meanwhile.
        longest_gap: Longest silence [s].
        below_zero: Pressures slightly below ambient, taken as ambient.
        refused: Commands that the twin refused, by reason.
        clock_offset: Lead of the stamps' clock over the recorder's [s]; None if it is the same.
        problem: Error of the first malformed message.
    """

    topic: str
    messages: int = 0
    malformed: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    late: int = 0
    missing: int = 0
    longest_gap: float = 0.0
    below_zero: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    clock_offset: float | None = None
    problem: str = ""

    def count_gaps(self, times: np.ndarray, limit: float | None) -> None:
        """Count silences in sorted times [ns]; `limit` [s], None for five usual periods."""
        # Probes of one topic may report at one time, or close together.
        steps = np.diff(np.unique(times)) * 1e-9
        if len(steps) < 2:
            return
        usual = _usual(steps)
        self.longest_gap = float(steps.max())
        gaps = steps[steps > (5.0 * usual if limit is None else limit)]
        self.missing = int(np.sum(np.round(gaps / usual) - 1.0))

    def as_dict(self) -> dict[str, Any]:
        """Return the counts by name."""
        return {**vars(self), "refused": dict(self.refused)}

    def warnings(self) -> list[str]:
        """Return the irregularities in words."""
        lines = [
            f"{count} {what}"
            for count, what in (
                (self.malformed, f"malformed ({self.problem})"),
                (self.duplicates, "duplicates dropped"),
                (self.out_of_order, "out of order, sorted"),
                (self.late, "late"),
                (self.missing, f"missing (longest silence {self.longest_gap:.3g} s), value held"),
                (self.below_zero, "a little below ambient, taken as ambient"),
            )
            if count
        ]
        lines += [f"{count} refused ({reason})" for reason, count in sorted(self.refused.items())]
        if self.clock_offset is not None:
            lines.append(f"stamps {self.clock_offset:+.3f} s from the recorder's clock, taken out")
        return lines


def read_channel(
    recording: Recording, topic: str, report: ChannelReport, *, by: str, late: float, gap: float | None
) -> list[DecodedMessage]:
    """Return the sound messages of a topic by time, and count the irregular ones in `report`.

    Args:
        recording: The bag.
        topic: A topic of it.
        report: The counts.
        by: 'stamp' for the time of the header if there is one, 'log' for the time of recording.
        late: Delay from stamp to recording above which a message counts as late [s].
        gap: Silence above which messages count as missing [s]; None for five usual periods.

    Raises:
        MappingError: The bag has no such topic.
    """
    if topic not in recording.topics:
        raise MappingError(f"{recording.name} has no topic {topic!r}, only {sorted(recording.topics)}")
    messages: list[object] = []
    stamped: list[int] = []
    logged: list[int] = []
    seen: set[tuple[int, bytes]] = set()
    for raw in recording.channels[topic].raw:
        report.messages += 1
        try:
            message = recording.decode(raw)
        except RecordingError as error:
            report.malformed += 1
            report.problem = report.problem or str(error)
            continue
        stamp = fields.stamp(message) or raw.time
        # A copy has the same stamp; without stamps, it has the same content at the same time.
        if (stamp, raw.cdr) in seen:
            report.duplicates += 1
            continue
        seen.add((stamp, raw.cdr))
        messages.append(message)
        stamped.append(stamp)
        logged.append(raw.time)
    if not messages:
        return []
    stamps, logs = np.array(stamped, dtype=np.int64), np.array(logged, dtype=np.int64)
    stamps = _on_the_recorders_clock(stamps, logs, report)
    report.late = int(np.sum(logs - stamps > late * 1e9))
    report.out_of_order = int(np.sum(stamps < np.maximum.accumulate(stamps)))
    times = stamps if by == "stamp" else logs
    order = np.argsort(times, kind="stable")
    report.count_gaps(times[order], gap)
    return [DecodedMessage(int(times[k]), messages[k]) for k in order]


def _usual(steps: np.ndarray) -> float:
    """Return the usual one of some periods: a quarter of the time is spent in periods up to it."""
    ordered = np.sort(steps)
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.25 * ordered.sum())])


def _on_the_recorders_clock(stamps: np.ndarray, logs: np.ndarray, report: ChannelReport) -> np.ndarray:
    ahead = stamps - logs
    if abs(int(np.median(ahead))) <= _ANOTHER_CLOCK:
        return stamps
    # The fastest message has the least delay in the difference of the clocks.
    offset = int(ahead.max())
    report.clock_offset = offset * 1e-9
    shifted: np.ndarray = stamps - offset
    return shifted

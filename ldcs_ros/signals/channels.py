"""The messages of a rig's topic: decoded, sorted, and with a count of each irregularity."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import MappingError, RecordingError
from ldcs_ros.signals import fields
from ldcs_ros.signals.stamps import SECOND, SMALLEST_STEP, on_recorders_clock

MOST_WARNED = 3


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
        repeated: Messages with stamp and content of an earlier one; all are taken.
        out_of_order: Messages with a stamp before that of an earlier one; sorted.
        late: Messages recorded long after their stamp.
        early: Messages recorded long before their stamp: the two clocks differ.
        missing: Missing messages, estimated from the silences; the last value is held meanwhile.
        longest_gap: Longest silence [s].
        silences: Silences longer than `gap`: begin after the start of the recording [s], length [s].
        below_zero: Pressures slightly below ambient, taken as ambient.
        refused: Commands that the twin refused, by reason.
        clock_offset: Lead of the stamps' clock over the recorder's [s]; None if it is the same.
        clock_steps: Steps of the stamps' clock during the recording [s].
        unstamped: Messages whose stamp is unset, does not advance or is too coarse; they hold at their log time.
        problem: Error of the first malformed message.
    """

    topic: str
    messages: int = 0
    malformed: int = 0
    repeated: int = 0
    out_of_order: int = 0
    late: int = 0
    early: int = 0
    missing: int = 0
    longest_gap: float = 0.0
    silences: tuple[tuple[float, float], ...] = ()
    below_zero: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    clock_offset: float | None = None
    clock_steps: tuple[float, ...] = ()
    unstamped: int = 0
    problem: str = ""

    def count_gaps(self, times: np.ndarray, limit: float | None, start: int) -> None:
        """Count silences in sorted times [ns], shape (n,).

        Args:
            times: Times of the messages.
            limit: Longest time between messages that is no silence [s]; None for five usual periods.
            start: Start of the recording [ns].
        """
        # Probes of one topic may report at one time, or close together.
        distinct = np.unique(times)
        steps = np.diff(distinct) * 1e-9
        if len(steps) < 2:
            return
        usual = _usual(steps)
        self.longest_gap = float(steps.max())
        silent = steps > (5.0 * usual if limit is None else limit)
        begins = (distinct[:-1] - start)[silent] * 1e-9
        self.silences = tuple(zip(begins.tolist(), steps[silent].tolist(), strict=True))
        self.missing = int(np.sum(np.round(steps[silent] / usual) - 1.0))

    def as_dict(self) -> dict[str, Any]:
        """Return the counts by name."""
        return {**vars(self), "refused": dict(self.refused)}

    def warnings(self) -> list[str]:
        """Return the irregularities in words."""
        lines = [
            f"{count} {what}"
            for count, what in (
                (self.malformed, f"malformed ({self.problem})"),
                (self.repeated, "with stamp and content of an earlier one"),
                (self.out_of_order, "out of order, sorted"),
                (self.late, "late"),
                (self.early, "recorded before their stamp (the clocks differ)"),
                (self.missing, f"missing ({self._silences_in_words()}), value held"),
                (self.unstamped, "without a stamp that tells their time, taken by log time"),
                (self.below_zero, "a little below ambient, taken as ambient"),
            )
            if count
        ]
        lines += [f"{count} refused ({reason})" for reason, count in sorted(self.refused.items())]
        if self.clock_offset is not None:
            lines.append(f"stamps {self.clock_offset:+.3f} s from the recorder's clock, taken out")
        if self.clock_steps:
            steps = ", ".join(f"{step:+.3f} s" for step in self.clock_steps[:MOST_WARNED])
            lines.append(
                f"the clock of the stamps was set {len(self.clock_steps)} time(s) ({steps}), taken out"
            )
        return lines

    def _silences_in_words(self) -> str:
        longest = sorted(self.silences, key=lambda silence: -silence[1])[:MOST_WARNED]
        words = ", ".join(f"{length:.3g} s at {begin:.3f} s" for begin, length in longest)
        count = len(self.silences)
        return f"a silence of {words}" if count == 1 else f"{count} silences, the longest {words}"


def read_channel(
    recording: Recording,
    topic: str,
    report: ChannelReport,
    *,
    by: str,
    late: float,
    gap: float | None,
    child: str = "",
) -> list[DecodedMessage]:
    """Return the sound messages of a topic by time, and count the irregular ones in `report`.

    Args:
        recording: The bag.
        topic: A topic of it.
        report: The counts.
        by: 'stamp' for the time of the header if there is one, 'log' for the time of recording.
        late: Delay from stamp to recording above which a message counts as late [s].
        gap: Silence above which messages count as missing [s]; None for five usual periods.
        child: Child frame of the transforms that are meant; '' for all messages.

    Raises:
        MappingError: The bag has no such topic.
    """
    if topic not in recording.topics:
        raise MappingError(f"{recording.name} has no topic {topic!r}, only {sorted(recording.topics)}")
    messages: list[object] = []
    stamped: list[int] = []
    logged: list[int] = []
    copies: list[bool] = []
    contents: dict[int, bytes] = {}
    for raw in recording.channels[topic].raw:
        report.messages += 1
        try:
            parts = fields.parts(recording.decode(raw), child)
        except RecordingError as error:
            report.malformed += 1
            report.problem = report.problem or str(error)
            continue
        for part in parts:
            # A time before 1970 is none.
            stamp = max(0, fields.stamp(part) or 0)
            messages.append(part)
            stamped.append(stamp)
            logged.append(raw.time)
            copies.append(contents.setdefault(stamp, raw.cdr) == raw.cdr)
    if not messages:
        return []
    stamps, logs = np.array(stamped, dtype=np.int64), np.array(logged, dtype=np.int64)
    times = logs
    if (stamps > 0).any():
        found = on_recorders_clock(stamps, logs, np.array(copies))
        usable = found.time[found.usable]
        delay = logs[found.usable] - usable
        report.late, report.early = int(np.sum(delay > late * SECOND)), int(np.sum(delay < -SMALLEST_STEP))
        report.out_of_order = int(np.sum(usable < np.maximum.accumulate(usable)))
        report.repeated = len(usable) - len(np.unique(usable))
        if by == "stamp":
            times = found.time
            report.unstamped = int(np.sum(~found.usable))
            report.clock_steps = tuple(step / SECOND for step in found.clock_steps)
            report.clock_offset = None if found.clock_offset is None else found.clock_offset / SECOND
    order = np.argsort(times, kind="stable")
    report.count_gaps(times[order], gap, recording.start)
    return [DecodedMessage(int(times[k]), messages[k]) for k in order]


def _usual(steps: np.ndarray) -> float:
    """Return the usual one of some periods: a quarter of the time is spent in periods up to it.

    The longest tenth is left out first, so that a silence is no period however long it lasts.
    """
    ordered = np.sort(steps)
    if len(ordered) > 3:
        ordered = ordered[: len(ordered) - max(1, len(ordered) // 10)]
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.25 * ordered.sum())])

"""What was found in a rig's topics: counted, so that nobody takes a bag with holes for a whole one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass
class Intake:
    """The messages of one mapped topic.

    Attributes:
        topic: Its name.
        messages: Messages in the bag.
        malformed: Messages that cannot be read as what the mapping says.
        duplicates: Messages that are there twice; one is taken.
        out_of_order: Messages with a stamp before that of an earlier one; sorted.
        late: Messages recorded long after their stamp.
        missing: Messages that the silences suggest are missing; the last value is held meanwhile.
        longest_gap: Longest silence [s].
        below_zero: Pressures a little below ambient, taken as ambient.
        refused: Commands that the twin refused, by reason.
        clock_offset: What the stamps' clock is ahead of the recorder's [s]; None if it is the same.
        problem: Why the first malformed message could not be read.
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
        if len(times) < 3:
            return
        steps = np.diff(times) * 1e-9
        usual = float(np.median(steps))
        self.longest_gap = float(steps.max())
        gaps = steps[steps > (5.0 * usual if limit is None else limit)]
        if usual > 0.0:
            self.missing = int(np.sum(np.round(gaps / usual) - 1.0))

    def as_dict(self) -> dict[str, Any]:
        """Return the counts by name."""
        return {**vars(self), "refused": dict(self.refused)}

    def remarks(self) -> list[str]:
        """Return what is worth telling, in words."""
        told = [
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
        told += [f"{count} refused ({reason})" for reason, count in sorted(self.refused.items())]
        if self.clock_offset is not None:
            told.append(f"stamps {self.clock_offset:+.3f} s from the recorder's clock, taken out")
        return told

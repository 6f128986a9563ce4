"""Output of verbs: JSON for machines, aligned lines for people, a progress bar on a terminal."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from tqdm import tqdm

    from ldcs_ros.bags import Recording
    from ldcs_ros.signals import Mapping


def print_json(result: object) -> None:
    """Print one JSON object; a number that JSON cannot hold (NaN, infinity) becomes null."""
    print(json.dumps(_plain(result), indent=2, ensure_ascii=False, allow_nan=False))


def print_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Print `name  value` lines with the values in one column."""
    lines = list(pairs)
    width = max((len(name) for name, _ in lines), default=0)
    for name, value in lines:
        print(f"{name:<{width}}  {value}")


def open_bag(path: Path) -> Recording:
    """Return the recording of a bag whose times will be used; omissions are printed on stderr.

    Raises:
        RecordingError: The bag cannot be read, or its recorder's clock was set.
    """
    from ldcs_ros.bags import read_bag
    from ldcs_ros.signals.tracks import check_one_clock

    recording = read_bag(path)
    check_one_clock(recording)
    print_notes(path, recording.notes)
    return recording


def open_bag_or_table(path: Path, mapping: Mapping | None) -> tuple[Recording, Mapping | None]:
    """Return the recording of a bag or a table and its mapping; omissions are printed on stderr.

    Raises:
        RecordingError: It cannot be read.
        MappingError: The mapping does not fit.
    """
    from ldcs_ros.signals.tables import open_recording

    recording, mapping = open_recording(path, mapping)
    print_notes(path, recording.notes)
    return recording, mapping


def print_notes(path: Path, notes: Iterable[str]) -> None:
    """Print what is worth knowing of a bag on stderr."""
    for note in notes:
        print(f"ldcs: note: {path}: {note}", file=sys.stderr)


class Progress:
    """A progress bar, shown only when stderr is a terminal and `quiet` is False.

    Args:
        total: End of the bar, in `unit`.
        label: The present task.
        unit: Unit of the progress, '' for a fraction.
        quiet: Show nothing.
    """

    def __init__(self, total: float, *, label: str, unit: str = "s", quiet: bool) -> None:
        self._bar: tqdm[NoReturn] | None = None
        self._label = label
        if sys.stderr.isatty() and not quiet:
            from tqdm import tqdm

            count = "{n:.2f}/{total:.2f} " + unit if unit else ""
            layout = f"{{desc}} {{percentage:3.0f}} % |{{bar}}| {count} [{{elapsed}}<{{remaining}}]"
            self._bar = tqdm(total=total, desc=label, leave=False, bar_format=layout, file=sys.stderr)

    def show(self, done: float) -> None:
        """Move the bar to `done` of its total."""
        if self._bar is not None:
            self._bar.update(done - self._bar.n)

    def say(self, what: str) -> None:
        """Write the present task after the bar's label."""
        if self._bar is not None and what:
            self._bar.set_description(f"{self._label}: {what}")

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays, without importing numpy here
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return str(value)

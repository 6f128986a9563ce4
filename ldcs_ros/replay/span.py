"""The time that a bag spans, checked before it is simulated."""

from __future__ import annotations

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError

# A silence is suspicious from this length on, if it is this many times as long as all the rest [s].
MAX_SILENCE = 60.0
SILENCE_RATIO = 10.0
MAX_SPAN = 30 * 86400.0


def check_span(recording: Recording) -> None:
    """Refuse a bag with a silence that is far longer than the rest: its recorder's clock was set meanwhile.

    Raises:
        RecordingError: There is such a silence, or the bag spans more than MAX_SPAN.
    """
    if recording.duration <= MAX_SILENCE:
        return
    spans = recording.spans()
    # Few bags have a chunk so long that a silence inside of it could count.
    if _is_suspicious(max(last - first for first, last in spans) / 1e9, recording):
        spans = [(message.time, message.time) for message in recording.in_order()]
    longest, begin, before = 0, recording.start, recording.start
    for first, last in spans:
        if first - before > longest:
            longest, begin = first - before, before
        before = max(before, last)
    silence = longest / 1e9
    if _is_suspicious(silence, recording):
        at = (begin - recording.start) / 1e9
        raise RecordingError(
            f"{recording.name} spans {_span(recording.duration)}, but is silent for {_span(silence)} after its first "
            f"{at:.3f} s: the clock of its recorder was set; cut it there; `ldcs replay` takes --duration, too"
        )
    if recording.duration > MAX_SPAN:
        raise RecordingError(
            f"{recording.name} spans {_span(recording.duration)}, expected at most {_span(MAX_SPAN)}; "
            "`ldcs replay` takes --duration"
        )


def _is_suspicious(silence: float, recording: Recording) -> bool:
    return silence > MAX_SILENCE and silence > SILENCE_RATIO * (recording.duration - silence)


def _span(seconds: float) -> str:
    for unit, length in (("years", 365.25 * 86400.0), ("days", 86400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.3f} s"

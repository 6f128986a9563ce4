"""A comparison from end to end: two recordings to offset, differences and checks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ldcs_ros.bags import Recording
from ldcs_ros.compare.alignment import Offset, Pair, estimate_offset
from ldcs_ros.compare.difference import (
    ChannelDifference,
    ErrorStatistics,
    FieldDifference,
    channel_difference,
    coverage,
    field_difference,
)
from ldcs_ros.compare.tolerances import Check, Tolerances, check
from ldcs_ros.errors import RecordingError
from ldcs_ros.signals import Mapping
from ldcs_ros.signals.signals import Signals, read_signals

SURFACE = "surface"
LEAST_SAMPLES = 5
LEAST_COVERAGE = 0.8
"""Samples, and fraction of the overlap and of the nodes that they cover, from which on a channel counts."""


@dataclass(frozen=True)
class Options:
    """The settings of a comparison.

    Attributes:
        mappings: Meaning of the topics of A and of B; None for a twin's bag, or to guess.
        offset: Lead of B's clock over A's [s]; None to estimate it unless both are simulation time.
        estimate: Use the estimate even if both are simulation time.
        measured: Take the reports of a twin's tracker, not the truth.
        relative: Compare the changes since the first common time.
        side_length: Length of the sheet [m]; None for that of the scenes.
        tolerances: Limits; empty for none.
    """

    mappings: tuple[Mapping | None, Mapping | None] = (None, None)
    offset: float | None = None
    estimate: bool = False
    measured: bool = False
    relative: bool = False
    side_length: float | None = None
    tolerances: Tolerances | None = None


@dataclass(frozen=True)
class Comparison:
    """The result of a comparison.

    Attributes:
        a, b: The two sides.
        offset: Offset of their clocks.
        channels: Differences by channel.
        surface: Difference of all nodes; None unless both recorded them.
        side_length: Length of the sheet [m]; None if unknown.
        relative: The changes since the first common time are compared.
        only: Channels that only one side has, in words.
        overlap: Time that both cover with what they have in common [s].
        checks: Limits with the values found.
    """

    a: Signals
    b: Signals
    offset: Offset
    channels: dict[str, ChannelDifference]
    surface: FieldDifference | None
    side_length: float | None
    relative: bool
    only: tuple[str, ...]
    overlap: float
    checks: tuple[Check, ...] = ()

    @property
    def passed(self) -> bool:
        """Every limit is kept."""
        return all(one.passed for one in self.checks)


def compare(recording_a: Recording, recording_b: Recording, options: Options) -> Comparison:
    """Return the difference of two recordings, A - B.

    Raises:
        RecordingError: They have nothing in common.
        MappingError: A mapping does not fit.
        ToleranceError: A limit is for something that was not compared.
    """
    names = _names(recording_a.name, recording_b.name)
    a, b = (
        read_signals(recording, name=name, mapping=mapping, measured=options.measured)
        for recording, name, mapping in zip((recording_a, recording_b), names, options.mappings, strict=True)
    )
    # One side may have measured a coordinate of a point alone.
    pairs = {
        name: (ours, theirs)
        for name in {**a.series, **b.series}
        if (ours := a.channel(name)) is not None
        and (theirs := b.channel(name)) is not None
        and ours.unit == theirs.unit
    }
    offset = _offset(pairs, a, b, options)
    length = options.side_length or a.side_length or b.side_length
    channels = {}
    start, end = _overlap(a, b, pairs, offset.value)
    for name, (ours, theirs) in pairs.items():
        found = channel_difference(
            name, ours, theirs, offset.value, side_length=length, relative=options.relative
        )
        if found is not None:
            channels[name] = replace(found, coverage=coverage(found.time, start, end))
    surface = None
    if a.surface is not None and b.surface is not None:
        surface = field_difference(a.surface, b.surface, offset.value, side_length=length)
    if surface is not None:
        surface = replace(surface, coverage=coverage(surface.time, start, end))
    if not channels and surface is None:
        raise RecordingError(
            f"{recording_a.name} and {recording_b.name} have no channel in common at one time: "
            f"{sorted(a.series)} against {sorted(b.series)}; name the topics in a mapping file"
        )
    only, overlap = _only(a, b), max(0.0, end - start)
    comparison = Comparison(a, b, offset, channels, surface, length, options.relative, only, overlap)
    if not options.tolerances:
        return comparison
    checks = check(options.tolerances, _statistics(comparison), uncounted(comparison))
    return replace(comparison, checks=tuple(checks))


def _overlap(a: Signals, b: Signals, pairs: dict[str, Pair], offset: float) -> tuple[float, float]:
    """Return the time that both recordings cover with what they have in common, on A's clock [s]."""
    ours, theirs = [pair[0].time for pair in pairs.values()], [pair[1].time for pair in pairs.values()]
    if a.surface is not None and b.surface is not None:
        ours, theirs = [*ours, a.surface.time], [*theirs, b.surface.time]
    if not ours:
        return 0.0, 0.0
    start = max(min(time[0] for time in ours), min(time[0] for time in theirs) - offset)
    end = min(max(time[-1] for time in ours), max(time[-1] for time in theirs) - offset)
    return float(start), float(end)


def uncounted(comparison: Comparison) -> dict[str, str]:
    """Return the channels that do not count against limits, each with the reason."""
    found = {name: _too_little(channel) for name, channel in comparison.channels.items()}
    if comparison.surface is not None:
        found[SURFACE] = _too_little(comparison.surface) or _too_few_nodes(comparison.surface)
    return {name: words for name, words in found.items() if words}


def _too_little(channel: ChannelDifference | FieldDifference) -> str:
    if len(channel.time) >= LEAST_SAMPLES and channel.coverage >= LEAST_COVERAGE:
        return ""
    return (
        f"{len(channel.time)} samples over {100.0 * channel.coverage:.0f} % of the overlap do not count, "
        f"expected {LEAST_SAMPLES} or more over {100.0 * LEAST_COVERAGE:.0f} %"
    )


def _too_few_nodes(surface: FieldDifference) -> str:
    if surface.measured >= LEAST_COVERAGE:
        return ""
    return (
        f"{100.0 * surface.measured:.0f} % of the nodes do not count, expected {100.0 * LEAST_COVERAGE:.0f} %"
    )


def _offset(pairs: dict[str, Pair], a: Signals, b: Signals, options: Options) -> Offset:
    estimated = estimate_offset(pairs)
    if options.offset is not None:
        return replace(estimated, value=options.offset, reason="given")
    if a.in_simulation_time and b.in_simulation_time and not options.estimate:
        return replace(estimated, value=0.0, reason="both are in simulation time")
    return estimated


def _statistics(comparison: Comparison) -> list[tuple[str, ErrorStatistics, str]]:
    found: list[tuple[str, ErrorStatistics, str]] = []
    for name, channel in comparison.channels.items():
        found.append((name, channel.overall, channel.unit))
        found += [
            (f"{name}.{axis}", one, channel.unit)
            for axis, one in channel.statistics.items()
            if axis not in ("", "distance")
        ]
    if comparison.surface is not None:
        found.append((SURFACE, comparison.surface.statistics, "m"))
    return found


def _names(a: str, b: str) -> tuple[str, str]:
    one, two = Path(a).name, Path(b).name
    return (a, b) if one == two else (one, two)


def _only(a: Signals, b: Signals) -> tuple[str, ...]:
    lines = []
    for one, other in ((a, b), (b, a)):
        partly = {name.rpartition(".")[0] for name in other.series}
        names = sorted(one.series.keys() - other.series.keys() - partly)
        names = [name for name in names if other.channel(name) is None]
        joints = [name for name in names if name.startswith("joint/")]
        if len(joints) > 2:
            names = [name for name in names if name not in joints] + [f"{len(joints)} joints"]
        if one.surface is not None and other.surface is None:
            names.append(SURFACE)
        if names:
            lines.append(f"only in {one.name}: {', '.join(names)}")
    return tuple(lines)

"""The report of a comparison: Markdown for people, a dict for machines."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ldcs_ros.compare.alignment import Offset
from ldcs_ros.compare.comparison import SURFACE, Comparison, uncounted
from ldcs_ros.compare.difference import ChannelDifference, ErrorStatistics, FieldDifference
from ldcs_ros.compare.formatting import milliseconds, number, percent, unit

REPORT = "compare.md"


def offset_lines(comparison: Comparison) -> list[str]:
    """Return the findings about the two clocks, in sentences."""
    offset, b = comparison.offset, comparison.b.name
    lines = [
        f"Clock offset used: {milliseconds(offset.value)} ({offset.reason}).",
        f"Both recordings cover {comparison.overlap:.3f} s.",
    ]
    if offset.estimate is not None:
        spread = (
            ""
            if offset.uncertainty is None
            else f" with a standard deviation of {1e3 * offset.uncertainty:.2g} ms"
        )
        lines.append(
            f"By the motion the clock of {b} is {milliseconds(offset.estimate)} ahead{spread}; "
            f"{percent(offset.unexplained)} of the motion's variance remain unexplained then "
            f"({len(offset.channels)} channels that move)."
        )
        if offset.alternatives:
            lines.append(f"The motion is periodic: the offset {alternatives(offset)}.")
    elif not offset.reason.startswith("nothing"):
        lines.append("Nothing moves enough in both to estimate it.")
    return lines


def alternatives(offset: Offset) -> str:
    """Return the other offsets that fit as well, in words."""
    return "could also be " + ", ".join(milliseconds(one) for one in offset.alternatives)


def write_report(comparison: Comparison, folder: Path, pictures: Sequence[Path]) -> Path:
    """Write compare.md, which shows the pictures beside it, and return its path.

    Raises:
        OSError: The folder cannot be written.
    """
    partial = folder / f".{REPORT}.partial"
    partial.write_text(markdown(comparison, [path.name for path in pictures]), encoding="utf-8")
    os.replace(partial, folder / REPORT)
    return folder / REPORT


def markdown(comparison: Comparison, pictures: Iterable[str]) -> str:
    """Return the report as Markdown; pictures are named relative to it."""
    a, b = comparison.a, comparison.b
    lines = [f"# {a.name} against {b.name}", ""]
    lines += [f"Differences are {a.name} minus {b.name}.", ""]
    if comparison.relative:
        lines += ["The changes since the first common time are compared.", ""]
    if comparison.checks:
        failed = sum(not one.passed for one in comparison.checks)
        total = len(comparison.checks)
        lines += [f"**{'Passed' if not failed else 'FAILED'}**: {total - failed} of {total} limits kept.", ""]
    lines += ["## Time", "", *(f"- {line}" for line in offset_lines(comparison)), ""]
    lines += _points(comparison)
    lines += _others(comparison)
    lines += _surface(comparison)
    lines += _checks(comparison)
    warnings = [f"{side.name}: {remark}" for side in (a, b) for remark in side.warnings]
    skipped = [
        f"{channel.name}: {channel.skipped} times left out, the other side was silent"
        for channel in comparison.channels.values()
        if channel.skipped
    ]
    sparse = [f"{name}: {words}" for name, words in uncounted(comparison).items()]
    notes = [*comparison.only, *skipped, *sparse, *warnings]
    if notes:
        lines += ["## Remarks", "", *(f"- {line}" for line in notes), ""]
    for picture in pictures:
        # Viewers of Markdown show no PDF.
        shown = "" if picture.endswith(".pdf") else "!"
        lines += [f"{shown}[{picture}]({picture})", ""]
    return "\n".join(lines)


def as_dict(comparison: Comparison, files: Iterable[str]) -> dict[str, Any]:
    """Return the comparison for machines; SI units."""
    surface = comparison.surface
    return {
        "a": comparison.a.name,
        "b": comparison.b.name,
        "offset": asdict(comparison.offset),
        "overlap": comparison.overlap,
        "side_length": comparison.side_length,
        "relative": comparison.relative,
        "channels": {
            name: {
                "unit": channel.unit,
                "samples": len(channel.time),
                "skipped": channel.skipped,
                "coverage": channel.coverage,
                "start": float(channel.time[0]),
                "end": float(channel.time[-1]),
                "figures": {axis or "value": asdict(found) for axis, found in channel.statistics.items()},
            }
            for name, channel in comparison.channels.items()
        },
        "surface": None
        if surface is None
        else {
            "unit": "m",
            "nodes": list(surface.nodes),
            "moments": len(surface.time),
            "coverage": surface.coverage,
            "measured": surface.measured,
            "worst_time": float(surface.time[surface.worst]),
            "figures": asdict(surface.statistics),
        },
        "only": list(comparison.only),
        "remarks": {side.name: side.warnings for side in (comparison.a, comparison.b)},
        "checks": [{**asdict(one), "passed": one.passed} for one in comparison.checks],
        "passed": comparison.passed,
        "files": list(files),
    }


def summary(comparison: Comparison) -> list[tuple[str, str]]:
    """Return the lines that the command line prints."""
    offset = comparison.offset
    clock = f"{milliseconds(offset.value)} ({offset.reason})"
    if offset.alternatives:
        clock += f"; periodic: {alternatives(offset)}"
    if offset.estimate is not None and offset.estimate != offset.value:
        clock += f"; by the motion {milliseconds(offset.estimate)}"
    lines = [("clock offset", clock), ("overlap", f"{comparison.overlap:.3f} s")]
    for name, channel in comparison.channels.items():
        if not name.startswith("joint/"):
            lines.append((name, f"{_sentence(channel.overall, channel.unit)}, {_samples(channel)}"))
    joints = [channel for name, channel in comparison.channels.items() if name.startswith("joint/")]
    if joints:
        worst = max(joints, key=lambda channel: channel.overall.max)
        lines.append(("joints", f"the worst, {worst.name[6:]}: {_sentence(worst.overall, 'rad')}"))
    if comparison.surface is not None:
        lines.append(
            (SURFACE, f"{_sentence(comparison.surface.statistics, 'm')}, {_samples(comparison.surface)}")
        )
    lines += [("remark", one) for one in comparison.only]
    for side in (comparison.a, comparison.b):
        lines += [("remark", f"{side.name}: {remark}") for remark in side.warnings]
    for one in comparison.checks:
        if not one.passed:
            lines.append(
                (
                    "FAILED",
                    f"{one.channel} {one.figure}: {one.problem}"
                    if one.problem
                    else f"{one.channel} {one.figure} {number(one.value, one.unit)} > "
                    f"{_limit(one.limit, one.unit)}",
                )
            )
    if comparison.checks:
        kept = sum(one.passed for one in comparison.checks)
        lines.append(("limits", f"{kept} of {len(comparison.checks)} kept"))
    return lines


def _samples(channel: ChannelDifference | FieldDifference) -> str:
    words = f"{len(channel.time)} samples over {100.0 * channel.coverage:.0f} % of the overlap"
    if isinstance(channel, FieldDifference) and channel.measured < 1.0:
        words += f", {100.0 * channel.measured:.3g} % of the nodes"
    return words


def _sentence(found: ErrorStatistics, si: str) -> str:
    ratio = "" if found.normalised_rms is None else f", RMS {percent(found.normalised_rms)} of the side"
    return (
        f"RMS {number(found.rms, si)}, 95 % below {number(found.p95, si)}, "
        f"at most {number(found.max, si)} {unit(si)}{ratio}"
    )


def _points(comparison: Comparison) -> list[str]:
    points = [channel for channel in comparison.channels.values() if channel.unit == "m"]
    if not points:
        return []
    lines = ["## Points", ""]
    if comparison.side_length is not None:
        lines += [f"Side length {number(comparison.side_length, 'm')} mm.", ""]
    lines += [
        "| point | axis | RMS [mm] | 95 % below [mm] | at most [mm] | mean [mm] | at the end [mm] "
        "| RMS / side | samples |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for channel in points:
        for axis, found in channel.statistics.items():
            lines.append(_row(channel, axis, found))
    return [*lines, ""]


def _row(channel: ChannelDifference, axis: str, found: ErrorStatistics) -> str:
    cells = [
        channel.name,
        axis,
        *(number(value, "m") for value in (found.rms, found.p95, found.max, found.mean, found.end)),
        percent(found.normalised_rms),
        str(len(channel.time)),
    ]
    return f"| {' | '.join(cells)} |"


def _others(comparison: Comparison) -> list[str]:
    others = [channel for channel in comparison.channels.values() if channel.unit != "m"]
    if not others:
        return []
    lines = [
        "## Drives",
        "",
        "| channel | unit | RMS | 95 % below | at most | mean | at the end | samples |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for channel in others:
        found = channel.overall
        values = [
            number(value, channel.unit) for value in (found.rms, found.p95, found.max, found.mean, found.end)
        ]
        cells = [channel.name, unit(channel.unit), *values, str(len(channel.time))]
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, ""]


def _surface(comparison: Comparison) -> list[str]:
    surface = comparison.surface
    if surface is None:
        return []
    found = surface.statistics
    return [
        "## Surface",
        "",
        f"All {2 * surface.nodes[0] * surface.nodes[1]} nodes at {len(surface.time)} moments; "
        f"the worst at t = {surface.time[surface.worst]:.3f} s.",
        "",
        "| RMS [mm] | 95 % below [mm] | at most [mm] | RMS at the end [mm] | RMS / side |",
        "|---|---|---|---|---|",
        "| "
        + " | ".join(
            [
                *(number(value, "m") for value in (found.rms, found.p95, found.max, found.end)),
                percent(found.normalised_rms),
            ]
        )
        + " |",
        "",
    ]


def _checks(comparison: Comparison) -> list[str]:
    if not comparison.checks:
        return []
    lines = ["## Limits", "", "| channel | figure | is | may be | |", "|---|---|---|---|---|"]
    for one in comparison.checks:
        cells = [
            one.channel,
            one.figure,
            f"{number(one.value, one.unit)} {unit(one.unit)}".strip(),
            _limit(one.limit, one.unit),
            "kept" if one.passed else f"**broken**{': ' if one.problem else ''}{one.problem}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, ""]


def _limit(limit: float, si: str) -> str:
    return f"{number(limit, si)} {unit(si)}".strip()

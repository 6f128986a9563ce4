"""Pictures of a comparison: both sides and their difference against time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.compare.comparison import Comparison
from ldcs_ros.compare.difference import ChannelDifference
from ldcs_ros.compare.words import NOTHING, SHOWN, figure, milliseconds, scale
from ldcs_ros.plotting.style import (
    AXIS_COLOURS,
    INK,
    LINE_COLOURS,
    SCREEN,
    SOFT_INK,
    Look,
    dress,
    heading,
    new_figure,
)

_ON_SCREEN = 9.2  # inches of width
_MOST_NAMED = 4


class _Line(NamedTuple):
    """One component of a channel: its label and colour, times [s], both values and their RMS difference in SI."""

    label: str
    colour: str
    time: np.ndarray
    a: np.ndarray
    b: np.ndarray
    rms: float


def channels_figure(comparison: Comparison, look: Look = SCREEN) -> Figure | None:
    """Draw a row for each point, for the pressures and for the joints: both sides, and beside it the difference.

    In one column of print the difference stands under both sides.
    """
    rows = _rows(comparison)
    if not rows:
        return None
    width = _ON_SCREEN if look.headed else look.width
    columns = 2 if width > 5.0 else 1
    lines = len(rows) * 2 // columns
    foot, head = look.inches(3.8), look.inches(5.7 if look.headed else 2.2)
    height = 0.88 * look.row * lines + head + foot
    whole = new_figure(width, height)
    grid = whole.add_gridspec(
        lines,
        columns,
        left=look.inches(5.3) / width,
        right=1.0 - look.inches(1.0) / width,
        bottom=foot / height,
        top=1.0 - head / height,
        hspace=0.42 if look.headed else 0.5,
        wspace=0.24,
    )
    for number_of_row, (title, channels) in enumerate(rows):
        both, apart = (whole.add_subplot(grid[divmod(2 * number_of_row + k, columns)]) for k in (0, 1))
        last = number_of_row == len(rows) - 1
        _draw_row(both, apart, title, channels, comparison, last=last, look=look)
    a, b = comparison.a.name, comparison.b.name
    note = f"lines: {a}   dots: {b}   clock offset {milliseconds(comparison.offset.value)}, {comparison.offset.reason}"
    heading(whole, f"{a} against {b}", note, look)
    return whole


def _rows(comparison: Comparison) -> list[tuple[str, list[ChannelDifference]]]:
    channels = list(comparison.channels.values())
    rows = [(channel.name, [channel]) for channel in channels if channel.unit == "m"]
    for unit, title in (("Pa", "pressure"), ("rad", "joints")):
        of_unit = [channel for channel in channels if channel.unit == unit]
        if of_unit:
            rows.append((title, of_unit))
    return rows


def _draw_row(
    both: Axes,
    apart: Axes,
    title: str,
    channels: list[ChannelDifference],
    comparison: Comparison,
    *,
    last: bool,
    look: Look,
) -> None:
    si = channels[0].unit
    shown, factor = SHOWN[si]
    lines = _lines(channels)
    largest = max(float(np.abs(line.a - line.b).max()) for line in lines)
    fine_unit, fine = scale(largest, si)
    for line in lines:
        # From where A begins: a picture of a motion, not of a place.
        origin = line.a[0] if si == "m" else 0.0
        both.plot(line.time, factor * (line.a - origin), color=line.colour, linewidth=1.5 * look.scale)
        every = max(1, len(line.time) // 60)
        dots: dict[str, Any] = {"color": line.colour, "linestyle": "none", "alpha": 0.75}
        dots |= {"marker": "o", "markersize": 2.6 * look.scale}
        both.plot(line.time[::every], factor * (line.b - origin)[::every], **dots)
        label = f"{line.label}  {figure(fine * line.rms)}" if len(lines) <= _MOST_NAMED else ""
        apart.plot(
            line.time, fine * (line.a - line.b), color=line.colour, linewidth=1.2 * look.scale, label=label
        )
    apart.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
    what = {"m": "displacement", "Pa": "gauge pressure", "rad": "angle"}[si]
    x_label = f"time of {comparison.a.name} [s]" if last else ""
    beside = both.get_position().y0 == apart.get_position().y0
    dress(both, x_label=x_label if beside else "", y_label=f"{what} [{shown}]", title=title, look=look)
    dress(apart, x_label=x_label, y_label=f"difference [{fine_unit}]", look=look)
    for axes in (both, apart):
        axes.margins(x=0.01, y=0.12)
    if fine * largest < NOTHING:
        apart.set_ylim(-1.0, 1.0)  # rounding is no difference: nobody need look at it through a lens
    _key(apart, lines, fine_unit, fine, look)


def _key(apart: Axes, lines: list[_Line], unit: str, factor: float, look: Look) -> None:
    style: dict[str, Any] = {"fontsize": look.label, "color": INK, "pad": 6.0 if look.headed else 3.0}
    if len(lines) > _MOST_NAMED:
        rms = factor * float(np.sqrt(np.mean([line.rms**2 for line in lines])))
        apart.set_title(f"RMS {figure(rms)} {unit} over {len(lines)} channels", loc="right", **style)
        return
    apart.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncol=_MOST_NAMED,
        fontsize=look.label if len(lines) < _MOST_NAMED else look.tick,
        labelcolor=INK,
        frameon=False,
        handlelength=0.8,
        handletextpad=0.4,
        columnspacing=0.8,
        borderpad=0.0,
    )
    # With four names there is no room for more than their unit.
    apart.set_title(f"RMS [{unit}]" if len(lines) < _MOST_NAMED else f"[{unit}]", loc="left", **style)


def _lines(channels: list[ChannelDifference]) -> list[_Line]:
    if channels[0].unit == "m":
        channel = channels[0]
        return [
            _Line(axis, colour, channel.time, channel.a[:, k], channel.b[:, k], channel.figures[axis].rms)
            for k, (axis, colour) in enumerate(AXIS_COLOURS.items())
        ]
    names: dict[str, list[ChannelDifference]] = {}
    for channel in channels:
        names.setdefault(_short(channel), []).append(channel)
    lines: list[_Line] = []
    for k, (name, alike) in enumerate(names.items()):
        # The two arms do the same more often than not.
        one = alike[0]
        same = len(alike) > 1 and all(_close(one, other) for other in alike[1:])
        for channel in alike[:1] if same else alike:
            label = name if same or len(alike) == 1 else f"{channel.name.split('/')[-1].split('_')[0]} {name}"
            colour = LINE_COLOURS[(k if same else len(lines)) % len(LINE_COLOURS)]
            a, b = channel.a[:, 0], channel.b[:, 0]
            lines.append(_Line(label, colour, channel.time, a, b, channel.overall.rms))
    return lines


def _short(channel: ChannelDifference) -> str:
    if channel.unit == "Pa":
        return channel.name.split("/")[0]
    return channel.name.split("/")[-1].removeprefix("left_").removeprefix("right_").removeprefix("joint_")


def _close(one: ChannelDifference, other: ChannelDifference) -> bool:
    return one.a.shape == other.a.shape and bool(
        np.allclose(one.a, other.a, rtol=0.0, atol=1e-6) and np.allclose(one.b, other.b, rtol=0.0, atol=1e-6)
    )

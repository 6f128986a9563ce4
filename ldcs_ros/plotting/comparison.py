"""Pictures of a comparison: both recordings and their difference against time, and the error of the surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from ldcs_ros.compare.comparison import Comparison
from ldcs_ros.compare.difference import ChannelDifference, FieldDifference
from ldcs_ros.compare.formatting import NOTHING, SHOWN, milliseconds, scale, three_digits
from ldcs_ros.plotting.axes3d import (
    MIN_HEIGHT,
    add_colour_bar,
    cell_means,
    new_axes_3d,
    quads,
    style_axes_3d,
)
from ldcs_ros.plotting.style import (
    AXIS_COLOURS,
    INK,
    LINE_COLOURS,
    PAGE,
    SCREEN,
    SOFT_INK,
    FigureStyle,
    add_title,
    new_figure,
    save_figure,
    style_axes,
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


def channels_figure(comparison: Comparison, style: FigureStyle = SCREEN) -> Figure | None:
    """Draw a row for each point, for the pressures and for the joints: both sides, and beside it the difference.

    In one column of print the difference stands under both sides.
    """
    rows = _rows(comparison)
    if not rows:
        return None
    width = _ON_SCREEN if style.headed else style.width
    columns = 2 if width > 5.0 else 1
    lines = len(rows) * 2 // columns
    foot, head = style.inches(3.8), style.inches(5.7 if style.headed else 2.2)
    height = 0.88 * style.row * lines + head + foot
    whole = new_figure(width, height)
    grid = whole.add_gridspec(
        lines,
        columns,
        left=style.inches(5.3) / width,
        right=1.0 - style.inches(1.0) / width,
        bottom=foot / height,
        top=1.0 - head / height,
        hspace=0.42 if style.headed else 0.5,
        wspace=0.24,
    )
    for number_of_row, (title, channels) in enumerate(rows):
        both, apart = (whole.add_subplot(grid[divmod(2 * number_of_row + k, columns)]) for k in (0, 1))
        last = number_of_row == len(rows) - 1
        _draw_row(both, apart, title, channels, comparison, last=last, style=style)
    a, b = comparison.a.name, comparison.b.name
    note = f"lines: {a}   dots: {b}   clock offset {milliseconds(comparison.offset.value)}, {comparison.offset.reason}"
    add_title(whole, f"{a} against {b}", note, style)
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
    style: FigureStyle,
) -> None:
    si = channels[0].unit
    shown, factor = SHOWN[si]
    lines = _lines(channels)
    largest = max(float(np.abs(line.a - line.b).max()) for line in lines)
    fine_unit, fine = scale(largest, si)
    for line in lines:
        # From where A begins: a picture of a motion, not of a place.
        origin = line.a[0] if si == "m" else 0.0
        both.plot(line.time, factor * (line.a - origin), color=line.colour, linewidth=1.5 * style.scale)
        every = max(1, len(line.time) // 60)
        dots: dict[str, Any] = {"color": line.colour, "linestyle": "none", "alpha": 0.75}
        dots |= {"marker": "o", "markersize": 2.6 * style.scale}
        both.plot(line.time[::every], factor * (line.b - origin)[::every], **dots)
        label = f"{line.label}  {three_digits(fine * line.rms)}" if len(lines) <= _MOST_NAMED else ""
        apart.plot(
            line.time, fine * (line.a - line.b), color=line.colour, linewidth=1.2 * style.scale, label=label
        )
    apart.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
    what = {"m": "displacement", "Pa": "gauge pressure", "rad": "angle"}[si]
    x_label = f"time of {comparison.a.name} [s]" if last else ""
    beside = both.get_position().y0 == apart.get_position().y0
    style_axes(both, x_label=x_label if beside else "", y_label=f"{what} [{shown}]", title=title, style=style)
    style_axes(apart, x_label=x_label, y_label=f"difference [{fine_unit}]", style=style)
    for axes in (both, apart):
        axes.margins(x=0.01, y=0.12)
    if fine * largest < NOTHING:
        apart.set_ylim(-1.0, 1.0)  # rounding is no difference and is not magnified
    _key(apart, lines, fine_unit, fine, style)


def _key(apart: Axes, lines: list[_Line], unit: str, factor: float, style: FigureStyle) -> None:
    text_options: dict[str, Any] = {
        "fontsize": style.label,
        "color": INK,
        "pad": 6.0 if style.headed else 3.0,
    }
    if len(lines) > _MOST_NAMED:
        rms = factor * float(np.sqrt(np.mean([line.rms**2 for line in lines])))
        apart.set_title(
            f"RMS {three_digits(rms)} {unit} over {len(lines)} channels", loc="right", **text_options
        )
        return
    apart.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncol=_MOST_NAMED,
        fontsize=style.label if len(lines) < _MOST_NAMED else style.tick,
        labelcolor=INK,
        frameon=False,
        handlelength=0.8,
        handletextpad=0.4,
        columnspacing=0.8,
        borderpad=0.0,
    )
    # With four names there is no room for more than their unit.
    apart.set_title(f"RMS [{unit}]" if len(lines) < _MOST_NAMED else f"[{unit}]", loc="left", **text_options)


def _lines(channels: list[ChannelDifference]) -> list[_Line]:
    if channels[0].unit == "m":
        channel = channels[0]
        axes = channel.name[-1] if "" in channel.statistics else "xyz"  # P1.z is one coordinate
        rms = {axis or axes: found.rms for axis, found in channel.statistics.items()}
        return [
            _Line(axis, AXIS_COLOURS[axis], channel.time, channel.a[:, k], channel.b[:, k], rms[axis])
            for k, axis in enumerate(axes)
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


ERROR_MAP = "magma_r"


class _Left(NamedTuple):
    """Left edges of the parts, as fractions of the picture's width."""

    sheet: float
    key: float
    plan: float
    plan_key: float
    history: float


_PARTS_ON_SCREEN = _Left(0.0, 0.355, 0.46, 0.632, 0.755)
_PARTS_IN_PRINT = _Left(0.0, 0.345, 0.47, 0.627, 0.79)
_WITHOUT_HEADING = 1.12  # what is below the heading fills its place


def surface_error_figure(surface: FieldDifference, a: str, b: str, style: FigureStyle = SCREEN) -> Figure:
    """Draw the distance of the nodes of one recording from where the other has them.

    Args:
        surface: The difference.
        a, b: Names of the recordings.
        style: Sizes; in print it is always as wide as a page.
    """
    # Its parts stand where they do whatever the size; letters shrink less than the picture does.
    whole = new_figure(11.4, 4.0) if style.headed else new_figure(PAGE.width, 0.32 * PAGE.width)
    unit, factor = scale(surface.statistics.max, "m")
    distance = factor * surface.distance[surface.worst]
    time = float(surface.time[surface.worst])
    norm = Normalize(0.0, max(float(np.nanmax(distance)), 1e-12))
    left = _PARTS_ON_SCREEN if style.headed else _PARTS_IN_PRINT
    up = 1.0 if style.headed else _WITHOUT_HEADING
    sheet = new_axes_3d(whole, (left.sheet, 0.02, 0.35, 0.80 * up))
    _draw_sheet(sheet, 1e3 * surface.place[1], distance[1], norm, style)
    key = whole.add_axes((left.key, 0.2 * up, 0.009, 0.5 * up))
    colours = ScalarMappable(norm=norm, cmap=ERROR_MAP)
    add_colour_bar(whole, key, colours, f"distance [{unit}]", style)
    _caption(whole, max(left.sheet, 0.02), f"worst moment, t = {time:.3f} s, top layer", style)
    plan = whole.add_axes((left.plan, 0.16 * up, left.plan_key - left.plan - 0.007, 0.60 * up))
    image = _draw_map(plan, factor * surface.rms_over_time, style)
    key = whole.add_axes((left.plan_key, 0.2 * up, 0.009, 0.5 * up))
    add_colour_bar(whole, key, image, f"RMS over time [{unit}]", style)
    _caption(whole, left.plan, "every node, over all moments", style)
    history = whole.add_axes((left.history, 0.16 * up, 0.99 - left.history, 0.60 * up))
    _draw_over_time(history, surface, factor, unit, style)
    _caption(whole, left.history, "all nodes, against time", style)
    found = surface.statistics
    note = (
        f"RMS {three_digits(factor * found.rms)} {unit}, 95 % below {three_digits(factor * found.p95)} {unit}, "
        f"at most {three_digits(factor * found.max)} {unit}"
    )
    add_title(whole, f"Surface: {a} against {b}", note, style)
    return whole


def _draw_sheet(
    axes: Axes3D, place: np.ndarray, distance: np.ndarray, norm: Normalize, style: FigureStyle
) -> None:
    colours = ScalarMappable(norm=norm, cmap=ERROR_MAP).to_rgba(cell_means(distance))
    cells = quads(place)
    known = np.isfinite(cells).all(axis=(1, 2))
    axes.add_collection3d(
        Poly3DCollection(
            cells[known], facecolors=colours[known], edgecolors=SOFT_INK, linewidths=0.4 * style.scale
        )
    )
    low, high = np.nanmin(place, axis=(0, 1)), np.nanmax(place, axis=(0, 1))
    high[2] = max(high[2], low[2] + MIN_HEIGHT * (high[0] - low[0]))
    style_axes_3d(axes, low, high, zoom=0.95, label_size=style.label - 1.0)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.labelpad = -4.0 if style.headed else -8.0
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize=style.tick - 1.5, colors=SOFT_INK, pad=-3 if style.headed else -4.5)


def _draw_map(axes: Axes, rms: np.ndarray, style: FigureStyle) -> AxesImage:
    nx, ny = rms.shape
    top = max(float(np.nanmax(rms)), 1e-12)
    extent = (-0.5, nx - 0.5, -0.5, ny - 0.5)
    image = axes.imshow(
        rms.T, origin="lower", extent=extent, cmap=ERROR_MAP, vmin=0.0, vmax=top, aspect="equal"
    )
    axes.set_xlabel("node i, from the clamp to the free edge", fontsize=style.label - 1.0, color=INK)
    axes.set_ylabel("node j", fontsize=style.label - 1.0, color=INK)
    axes.tick_params(labelsize=style.tick, colors=SOFT_INK, length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    return image


def _draw_over_time(
    axes: Axes, surface: FieldDifference, factor: float, unit: str, style: FigureStyle
) -> None:
    largest = np.nanmax(surface.distance, axis=(1, 2, 3))
    marker = "o" if len(surface.time) == 1 else ""
    axes.plot(
        surface.time,
        factor * largest,
        color=LINE_COLOURS[1],
        linewidth=1.3 * style.scale,
        marker=marker,
        label="largest",
    )
    axes.plot(
        surface.time,
        factor * surface.rms_over_nodes,
        color=LINE_COLOURS[0],
        linewidth=1.6 * style.scale,
        marker=marker,
        label="RMS",
    )
    style_axes(axes, x_label="time [s]", y_label=f"distance [{unit}]", style=style)
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.01)
    axes.legend(
        fontsize=style.label,
        frameon=False,
        loc="lower right",
        bbox_to_anchor=(1.02, 0.98),
        ncol=2,
        borderpad=0.0,
    )


def _caption(figure: Figure, left: float, text: str, style: FigureStyle) -> None:
    height = 0.82 if style.headed else 0.82 * _WITHOUT_HEADING
    figure.text(left, height, text, fontsize=style.label, color=INK, va="bottom")


def draw_comparison(
    comparison: Comparison, folder: Path, *, kind: str = "png", style: FigureStyle = SCREEN
) -> list[Path]:
    """Write the pictures of a comparison into a folder that exists, and return their paths.

    Args:
        comparison: The comparison.
        folder: The folder.
        kind: Format: 'png', 'pdf', 'svg'.
        style: Their sizes, for a screen or for print.
    """
    written = []
    channels = channels_figure(comparison, style)
    if channels is not None:
        written.append(save_figure(channels, folder / f"compare.{kind}", style))
    if comparison.surface is not None:
        figure = surface_error_figure(comparison.surface, comparison.a.name, comparison.b.name, style)
        written.append(save_figure(figure, folder / f"surface_error.{kind}", style))
    return written

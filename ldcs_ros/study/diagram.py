"""The work-precision diagram: error against CPU time, a panel for each problem, and the lattice's own error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ldcs_ros.plotting.style import (
    GRID,
    INK,
    LABEL_SIZE,
    LINE_COLOURS,
    SOFT_INK,
    add_title,
    new_figure,
    save_figure,
    style_axes,
)
from ldcs_ros.study.command_rates import SMOOTH, RateCost, rate_costs
from ldcs_ros.study.report import short_reason
from ldcs_ros.study.rows import BASELINE, Row
from ldcs_ros.study.scaling import measured_sizes, peak_memory
from ldcs_ros.study.spatial_convergence import errors_against_finest
from ldcs_ros.study.targets import MAX_EXPONENT

# The default method and its two competitors are distinct; the others share the palette in a fixed order.
COLOURS = {
    "esdirk43": LINE_COLOURS[0],
    "trbdf2": LINE_COLOURS[5],
    "rosenbrock_w": LINE_COLOURS[2],
    "linearly_implicit_euler": "#7A9E3B",
    "rkc2": LINE_COLOURS[4],
    "rk4": LINE_COLOURS[3],
    "semi_implicit_euler": "#8C5A9E",
    "exponential": LINE_COLOURS[1],
    BASELINE: LINE_COLOURS[6],
    "scipy_BDF": LINE_COLOURS[7],
    "scipy_Radau": "#C4B8A0",
}
COST = "CPU s per simulated s"
TITLES = {"arc_axiswise": "arc, law axiswise"}
ERROR_LIMITS = (3e-3, 1e-10)  # m, the exact ones to the right
FAILURE_PLACE = 1.8e-3  # m: marks of failures are at the left
GUTTER_LINE = 0.06  # height of a line of their texts, as a fraction of the panel's
COLUMNS = 3
SUMMARY, SUMMARY_ERROR = ("paper", 9), 1e-8  # m: right end of its axis
RATE_COLOURS = (LINE_COLOURS[0], LINE_COLOURS[1], LINE_COLOURS[2])
LEAST_RATE = 3.0  # Hz: place of the smooth case


def draw_summary(rows: Sequence[Row], path: Path) -> Path:
    """Draw two panels of a study's rows into a PNG: `SUMMARY`, and commands at a rate; returns its path."""
    own = [row for row in rows if row.kind == "curve" and (row.scene, row.nodes) == SUMMARY]
    rates = rate_costs(rows)
    figure = new_figure(11.0, 5.4, dpi=110)
    left, right = figure.subplots(1, 2)
    _panel(left, *SUMMARY, own)
    left.set_xlim(ERROR_LIMITS[0], SUMMARY_ERROR)
    if rates:
        _rates_panel(right, rates)
    else:
        right.set_axis_off()
    figure.subplots_adjust(0.07, 0.235, 0.985, 0.82, 0.2)
    _legend(figure, {row.method for row in own}, columns=4)
    add_title(
        figure,
        "What accuracy costs: CPU time against the largest node position error",
        "one thread; down: cheap, right: accurate; a cross: no result",
    )
    return save_figure(figure, path)


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw all panels of a study's rows into a PNG; returns its path."""
    curves = [row for row in rows if row.kind == "curve"]
    problems = sorted({(row.scene, row.nodes) for row in curves}, key=lambda p: (p[0] != "arc", p[0], p[1]))
    spatial, sizes, rates = errors_against_finest(rows), measured_sizes(rows), rate_costs(rows)
    panels = len(problems) + bool(spatial) + (len(sizes) > 1) + bool(rates)
    lines = math.ceil(panels / COLUMNS)
    figure = new_figure(13.0, 0.9 + 3.9 * lines + 0.9, dpi=75)
    grid = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for axes, (scene, nodes) in zip(grid, problems, strict=False):
        _panel(axes, scene, nodes, [row for row in curves if (row.scene, row.nodes) == (scene, nodes)])
    extra = iter(grid[len(problems) :])
    if spatial:
        _lattice_panel(next(extra), spatial)
    if len(sizes) > 1:
        _scaling_panel(next(extra), sizes)
    if rates:
        _rates_panel(next(extra), rates)
    for axes in grid[panels:]:
        axes.set_axis_off()
    height = figure.get_figheight()
    figure.subplots_adjust(0.055, 1.25 / height, 0.99, 1.0 - 0.95 / height, 0.24, 0.38)
    _legend(figure, {row.method for row in curves})
    add_title(
        figure,
        "What accuracy costs: CPU time against the largest node position error",
        "one thread, one process; up: costly, right: accurate; filled: adaptive, open: fixed steps, cross: no result",
    )
    return save_figure(figure, path)


def _panel(axes: Axes, scene: str, nodes: int, rows: Sequence[Row]) -> None:
    title = f"{TITLES.get(scene, scene)}, {nodes} x {nodes}"
    _log_axes(axes, x_label="largest error [m]", y_label=COST, title=title)
    for method in COLOURS:
        for setting, face in (("accuracy", COLOURS[method]), ("dt", "white")):
            made = [row for row in rows if (row.method, row.setting) == (method, setting) and not row.failure]
            made.sort(key=lambda row: row.value)
            if made:
                axes.plot(
                    [row.error for row in made],
                    [row.cpu for row in made],
                    color=COLOURS[method],
                    marker="s" if method == BASELINE else "o",
                    markersize=5.0,
                    markerfacecolor=face,
                    linewidth=2.2 if method in ("esdirk43", BASELINE) else 1.2,
                    linestyle="-" if setting == "accuracy" or method == BASELINE else ":",
                    zorder=4 if method == "esdirk43" else 3,
                )
    axes.axhline(1.0, color=SOFT_INK, linewidth=0.9, linestyle="--", zorder=1)
    axes.set_xlim(*ERROR_LIMITS)
    low, high = axes.get_ylim()
    axes.set_ylim(low / 1.5, max(high, 2.0) * 2.0)
    text = axes.text(0.99, 1.08, "real time", fontsize=7.5, color=SOFT_INK, ha="right", va="bottom")
    text.set_transform(axes.get_yaxis_transform())
    failures = [row for row in rows if row.failure]
    if failures:
        _mark_failures(axes, failures)


def _mark_failures(axes: Axes, rows: Sequence[Row]) -> None:
    # A gutter of its own at the top: texts cover no curve and no other text.
    low, high = axes.get_ylim()
    line = (high / low) ** (GUTTER_LINE / (1.0 - GUTTER_LINE * (len(rows) + 1)))
    taken = high * line ** (len(rows) + 1)
    axes.set_ylim(low, taken)
    for row in sorted(rows, key=lambda row: -row.cpu if math.isfinite(row.cpu) else -math.inf):
        taken /= line
        axes.plot(
            [FAILURE_PLACE], [taken], marker="x", color=COLOURS[row.method], markersize=6, markeredgewidth=1.8
        )
        reason = short_reason(row.failure).partition(":")[0]
        text = f"{_name(row.method)}, {row.setting} {row.value:g}: {reason}"
        axes.text(FAILURE_PLACE * 0.6, taken, text, fontsize=7, color=INK, va="center")


def _lattice_panel(axes: Axes, errors: dict[int, float]) -> None:
    title = "arc_material: the lattice's own error"
    _log_axes(axes, x_label="nodes along a side", y_label="error of P0, P1 [m]", title=title)
    nodes, values = list(errors), list(errors.values())
    axes.plot(nodes, values, color=LINE_COLOURS[1], marker="o", linewidth=2.0)
    for n, value in errors.items():
        axes.annotate(
            f"{1e3 * value:.2g} mm", (n, value), (6, 6), textcoords="offset points", fontsize=8, color=INK
        )
    axes.set_xlim(nodes[0] / 1.3, nodes[-1] * 2.0)
    axes.set_ylim(2e-6, max(values) * 4.0)
    axes.set_xticks(nodes, [str(n) for n in nodes])
    axes.minorticks_off()
    axes.axhspan(2e-6, 1e-5, color=GRID, zorder=0)
    axes.text(
        nodes[-1] * 1.9,
        4.5e-6,
        "default accuracy in time",
        fontsize=8,
        color=SOFT_INK,
        ha="right",
        va="center",
    )


def _scaling_panel(axes: Axes, rows: Sequence[Row]) -> None:
    title = f"{rows[0].scene}: cost by size at {rows[0].value:.0e} m"
    _log_axes(axes, x_label="nodes along a side", y_label=COST, title=title)
    sides, costs = [row.nodes for row in rows], [row.cpu for row in rows]
    for power, style in ((1.0, ":"), (MAX_EXPONENT, "--"), (2.0, ":")):
        guide = [costs[0] * (n / sides[0]) ** (2.0 * power) for n in sides]
        axes.plot(sides, guide, color=SOFT_INK, linewidth=0.9, linestyle=style, zorder=1)
        place, text = (sides[-1], guide[-1]), f"nodes^{power:g}"
        axes.annotate(text, place, (4, -3), textcoords="offset points", fontsize=7.5, color=SOFT_INK)
    axes.plot(sides, costs, color=LINE_COLOURS[0], marker="o", linewidth=2.2, zorder=3)
    for row in rows:
        place, text = (row.nodes, row.cpu), f"{peak_memory(row):.0f} MiB"
        axes.annotate(text, place, (-7, 7), textcoords="offset points", fontsize=8, color=INK, ha="right")
    axes.set_xlim(sides[0] / 2.2, sides[-1] * 2.2)
    axes.set_xticks(sides, [str(n) for n in sides])
    axes.minorticks_off()
    axes.axhline(1.0, color=SOFT_INK, linewidth=0.9, linestyle="--", zorder=1)


def _rates_panel(axes: Axes, costs: dict[tuple[str, float], RateCost]) -> None:
    _log_axes(axes, x_label="commands per second (left: smooth)", y_label=COST, title="commands at a rate")
    places = {rate: max(rate, LEAST_RATE) for rate in sorted({rate for _, rate in costs})}
    for colour, scene in zip(RATE_COLOURS, dict.fromkeys(scene for scene, _ in costs), strict=False):
        ours = [(places[rate], cost.row.cpu) for (name, rate), cost in costs.items() if name == scene]
        axes.plot(*zip(*ours, strict=True), color=colour, marker="o", linewidth=2.0, label=scene)
    loop = [
        (rate, other.cpu)
        for (_, rate), cost in costs.items()
        if (other := cost.others.get(BASELINE)) is not None and other.cpu > 0
    ]
    if loop:
        label = "arc_pushed, compiled RKC2"
        axes.plot(*zip(*loop, strict=True), color=COLOURS[BASELINE], marker="s", linewidth=1.4, label=label)
    axes.set_xticks(list(places.values()), ["smooth" if rate == SMOOTH else f"{rate:g}" for rate in places])
    axes.minorticks_off()
    axes.axhline(1.0, color=SOFT_INK, linewidth=0.9, linestyle="--", zorder=1)
    # Room for the legend above all curves.
    low, high = axes.get_ylim()
    axes.set_ylim(low, max(high, 1.5) * (max(high, 1.5) / low) ** 0.5)
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def _log_axes(axes: Axes, *, x_label: str, y_label: str, title: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    style_axes(axes, x_label=x_label, y_label=y_label, title=title)


def _legend(figure: Figure, methods: set[str], *, columns: int = 6) -> None:
    shown = [method for method in COLOURS if method in methods]
    handles = [
        Line2D([], [], color=COLOURS[m], marker="s" if m == BASELINE else "o", linewidth=2.0, label=_name(m))
        for m in shown
    ]
    figure.legend(handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=LABEL_SIZE)


def _name(method: str) -> str:
    return {BASELINE: "compiled RKC2 baseline"}.get(method, method.replace("_", " "))

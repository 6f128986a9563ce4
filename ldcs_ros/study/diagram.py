"""The work-precision diagram: error against CPU time, a panel for each problem, and the lattice's own error."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

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
from ldcs_ros.study.command_rates import SMOOTH, against_smooth
from ldcs_ros.study.growth import measured, peak_memory
from ldcs_ros.study.spatial import against_finest
from ldcs_ros.study.targets import MOST_EXPONENT
from ldcs_ros.study.tasks import BASELINE, Row

# The default method and the two to compare with stand out; the others share the palette in a fixed order.
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
TITLES = {"arc_axiswise": "arc, law axiswise"}
ERROR_LIMITS = (3e-3, 1e-10)  # m, the exact ones to the right
FAILURE_PLACE = 1.8e-3  # m: failures stand in a gutter at the left
COLUMNS = 3
RATE_COLOURS = (LINE_COLOURS[0], LINE_COLOURS[1], LINE_COLOURS[2])
LEAST_RATE = 3.0  # Hz: where the smooth case stands


def draw(rows: list[Row], path: Path) -> Path:
    """Draw the diagram of a study's rows into a PNG; returns its path."""
    curves = [row for row in rows if row.kind == "curve"]
    problems = sorted({(row.scene, row.nodes) for row in curves}, key=lambda p: (p[0] != "arc", p[0], p[1]))
    spatial = against_finest(rows)
    growing, rates = len(measured(rows)) > 1, against_smooth(rows)
    panels = len(problems) + bool(spatial) + growing + bool(rates)
    lines = math.ceil(panels / COLUMNS)
    figure = new_figure(13.0, 0.9 + 3.9 * lines + 0.9, dpi=110)
    grid = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for axes, (scene, nodes) in zip(grid, problems, strict=False):
        _panel(axes, scene, nodes, [row for row in curves if (row.scene, row.nodes) == (scene, nodes)])
    extra = iter(grid[len(problems) :])
    if spatial:
        _lattice_panel(next(extra), spatial)
    if growing:
        _growth_panel(next(extra), measured(rows))
    if rates:
        _rates_panel(next(extra), rates, rows)
    for axes in grid[panels:]:
        axes.set_axis_off()
    height = figure.get_figheight()
    figure.subplots_adjust(0.055, 1.25 / height, 0.99, 1.0 - 0.95 / height, 0.24, 0.38)
    _legend(figure, {row.method for row in curves})
    add_title(
        figure,
        "What accuracy costs: CPU time against the largest node position error",
        "one thread, one process; up and to the right is dear and exact; filled: adaptive, open: fixed steps, "
        "cross: no result (reason beside it)",
    )
    return save_figure(figure, path)


def _panel(axes: Any, scene: str, nodes: int, rows: list[Row]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    style_axes(axes, x_label="largest error [m]", y_label="CPU s per simulated s", title=_title(scene, nodes))
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
    axes.text(1.3e-10, 1.08, "real time", fontsize=7.5, color=SOFT_INK, ha="right", va="bottom")
    _mark_failures(axes, [row for row in rows if row.failure])


def _mark_failures(axes: Any, rows: list[Row]) -> None:
    low, high = axes.get_ylim()
    span = math.log(high / low)
    taken = high
    for row in sorted(rows, key=lambda row: -row.cpu if math.isfinite(row.cpu) else -math.inf):
        # Where its pace puts it, or at the top; below the mark before it, so that texts stay apart.
        wanted = min(row.cpu, high) if math.isfinite(row.cpu) else high
        taken = min(wanted, taken) * math.exp(-0.055 * span)
        axes.plot(
            [FAILURE_PLACE], [taken], marker="x", color=COLOURS[row.method], markersize=6, markeredgewidth=1.8
        )
        text = f"{_name(row.method)}, {row.setting} {row.value:g}: {short_reason(row.failure)}"
        axes.text(FAILURE_PLACE * 0.6, taken, text, fontsize=7, color=INK, va="center")


def _lattice_panel(axes: Any, errors: dict[int, float]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    style_axes(
        axes,
        x_label="nodes along a side",
        y_label="error of P0, P1 [m]",
        title="arc_material: the lattice's own error",
    )
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


def _growth_panel(axes: Any, rows: list[Row]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    title = f"{rows[0].scene}: cost by size at {rows[0].value:.0e} m"
    style_axes(axes, x_label="nodes along a side", y_label="CPU s per simulated s", title=title)
    sides, costs = [row.nodes for row in rows], [row.cpu for row in rows]
    for power, style in ((1.0, ":"), (MOST_EXPONENT, "--"), (2.0, ":")):
        guide = [costs[0] * (n / sides[0]) ** (2.0 * power) for n in sides]
        axes.plot(sides, guide, color=SOFT_INK, linewidth=0.9, linestyle=style, zorder=1)
        place, text = (sides[-1], guide[-1]), f"nodes^{power:g}"
        axes.annotate(text, place, (4, -3), textcoords="offset points", fontsize=7.5, color=SOFT_INK)
    axes.plot(sides, costs, color=LINE_COLOURS[0], marker="o", linewidth=2.2, zorder=3)
    for row in rows:
        place, text = (row.nodes, row.cpu), f"{peak_memory(row):.0f} MiB"
        axes.annotate(text, place, (8, -6), textcoords="offset points", fontsize=8, color=INK)
    axes.set_xlim(sides[0] / 1.3, sides[-1] * 2.2)
    axes.set_xticks(sides, [str(n) for n in sides])
    axes.minorticks_off()
    axes.axhline(1.0, color=SOFT_INK, linewidth=0.9, linestyle="--", zorder=1)


def _rates_panel(axes: Any, rates: dict[str, dict[float, tuple[float, Row]]], rows: list[Row]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    style_axes(
        axes,
        x_label="commands a second (left: smooth)",
        y_label="CPU s per simulated s",
        title="commands at a rate",
    )
    known = sorted({rate for by_rate in rates.values() for rate in by_rate})
    places = {rate: max(rate, LEAST_RATE) for rate in known}
    for colour, (scene, by_rate) in zip(RATE_COLOURS, rates.items(), strict=False):
        costs = [row.cpu for _, row in by_rate.values()]
        axes.plot(
            [places[rate] for rate in by_rate], costs, color=colour, marker="o", linewidth=2.0, label=scene
        )
    loop = sorted(
        (row.value, row.cpu) for row in rows if row.kind == "rate" and row.method == BASELINE and row.cpu > 0
    )
    if loop:
        label = "arc_pushed, compiled RKC2"
        axes.plot(*zip(*loop, strict=True), color=COLOURS[BASELINE], marker="s", linewidth=1.4, label=label)
    axes.set_xticks(list(places.values()), ["smooth" if rate == SMOOTH else f"{rate:g}" for rate in places])
    axes.minorticks_off()
    axes.axhline(1.0, color=SOFT_INK, linewidth=0.9, linestyle="--", zorder=1)
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def _legend(figure: Any, methods: set[str]) -> None:
    from matplotlib.lines import Line2D

    shown = [method for method in COLOURS if method in methods]
    handles = [
        Line2D([], [], color=COLOURS[m], marker="s" if m == BASELINE else "o", linewidth=2.0, label=_name(m))
        for m in shown
    ]
    figure.legend(handles=handles, loc="lower center", ncols=6, frameon=False, fontsize=LABEL_SIZE)


def _name(method: str) -> str:
    return {BASELINE: "compiled RKC2 baseline"}.get(method, method.replace("_", " "))


def _title(scene: str, nodes: int) -> str:
    return f"{TITLES.get(scene, scene)}, {nodes} x {nodes}"


def short_reason(failure: str) -> str:
    """Return a failure in a few words."""
    for sign, words in (
        ("too slow", failure.split(" by its")[0].replace(" CPU s per simulated second", " CPU s a second")),
        ("stability limit", "above its stability limit"),
        ("does not converge", "does not converge"),
        ("grows", "becomes unstable"),
        ("left the sheet", "leaves the sheet"),
        ("not linear", "for linear scenes only"),
        ("the fixed step", "a step fails"),
    ):
        if sign in failure:
            return words
    return failure if len(failure) < 50 else f"{failure[:47]}..."

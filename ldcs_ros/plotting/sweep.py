"""The picture of a sweep: measures against factors, a map for two factors on a grid, Sobol indices as bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import (
    LINE_COLOURS,
    SCREEN,
    SOFT_INK,
    SURFACE_MAP,
    FigureStyle,
    add_title,
    new_figure,
    style_axes,
)

MM = 1e3


def sweep_figure(
    factors: Sequence[str],
    measures: Sequence[str],
    samples: np.ndarray,
    measured: np.ndarray,
    *,
    title: str,
    indices: Sequence[tuple[np.ndarray, np.ndarray]] = (),
    style: FigureStyle = SCREEN,
) -> Figure:
    """Draw a sweep; a row of panels for each measure.

    Args:
        factors: Names of the factors.
        measures: Names of the measures.
        samples: Values of the factors, shape (n, n_factors).
        measured: Values of the measures [m], shape (n, n_measures); NaN is not drawn.
        title: Heading of the figure.
        indices: First and total Sobol indices of each measure, shape (n_factors,) each; () without them.
        style: Sizes.
    """
    levels = [np.unique(column) for column in samples.T]
    on_grid = (
        len(factors) == 2 and len(levels[0]) * len(levels[1]) == len(samples) and min(map(len, levels)) > 1
    )
    columns = (1 if on_grid else len(factors)) + (1 if indices else 0)
    figure = new_figure(max(style.width, 2.6 * columns), (style.row + 0.4) * len(measures) + 0.5)
    grid = figure.subplots(len(measures), columns, squeeze=False)
    for row, measure in enumerate(measures):
        label = f"{measure} [mm]"
        values = MM * measured[:, row]
        if on_grid:
            _map(
                figure,
                grid[row, 0],
                levels,
                values.reshape(len(levels[0]), len(levels[1])),
                factors,
                label,
                style,
            )
        else:
            for k, factor in enumerate(factors):
                _scatter(grid[row, k], samples[:, k], values, len(factors) == 1)
                style_axes(grid[row, k], x_label=factor, y_label=label if k == 0 else "", style=style)
        if indices:
            _bars(grid[row, -1], factors, *indices[row])
            style_axes(grid[row, -1], x_label=f"Sobol index of {measure}", y_label="", style=style)
    add_title(figure, title, style=style)
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - (0.35 if style.headed else 0.0) / figure.get_figheight()))
    return figure


def _scatter(axes: Axes, x: np.ndarray, y: np.ndarray, joined: bool) -> None:
    order = np.argsort(x, kind="stable")
    axes.plot(
        x[order], y[order], "o-" if joined else "o", markersize=3.0, linewidth=1.2, color=LINE_COLOURS[0]
    )


def _map(
    figure: Figure,
    axes: Axes,
    levels: Sequence[np.ndarray],
    values: np.ndarray,
    factors: Sequence[str],
    label: str,
    style: FigureStyle,
) -> None:
    drawn = axes.pcolormesh(levels[0], levels[1], values.T, cmap=SURFACE_MAP, shading="nearest")
    bar = figure.colorbar(drawn, ax=axes)
    bar.set_label(label, fontsize=style.label)
    bar.ax.tick_params(labelsize=style.tick, colors=SOFT_INK)
    style_axes(axes, x_label=factors[0], y_label=factors[1], style=style)
    axes.grid(False)


def _bars(axes: Axes, factors: Sequence[str], first: np.ndarray, total: np.ndarray) -> None:
    places = np.arange(len(factors))
    axes.barh(places - 0.2, total, height=0.38, color=LINE_COLOURS[1], label="total")
    axes.barh(places + 0.2, first, height=0.38, color=LINE_COLOURS[0], label="first")
    axes.set_yticks(places, [path.removeprefix("effects.") for path in factors])
    axes.set_xlim(left=min(0.0, float(first.min())))
    axes.legend(frameon=False, fontsize="small")

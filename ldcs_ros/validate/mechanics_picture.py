"""The picture of the mechanics: the elastica with the lattice's tips, and each comparison's error by mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ldcs_ros.plotting.style import INK, LINE_COLOURS, SOFT_INK, add_title, new_figure, style_axes
from ldcs_ros.validate.benchmark import Benchmark
from ldcs_ros.validate.mechanics import ELASTICA_LOADS, elastica
from ldcs_ros.validate.problems import LENGTH

TARGET = 2.0
"""Error that the material is asked to stay within at 33 nodes [%]."""
_SMALLEST = 0.01  # %: smaller errors are drawn there


def mechanics_figure(found: Sequence[Benchmark]) -> Figure:
    """Draw the elastica beside the tips of the lattice, and the error of each comparison by number of nodes."""
    height = 0.26 * len(found) + 1.9
    figure = new_figure(12.0, height)
    bottom, top = 0.62 / height, 1.0 - 1.0 / height
    axes = figure.add_axes((0.05, bottom, 0.24, top - bottom))
    loads = np.linspace(0.02, 1.1 * ELASTICA_LOADS[-1], 30)
    axes.plot([elastica(load)[1] for load in loads], loads, color=INK, linewidth=1.4, label="elastica")
    bent = [one for one in found if one.name.startswith("cantilever, tip load")]
    meshes = sorted({nodes for one in found for nodes in one.values})
    for nodes, colour in zip(meshes, LINE_COLOURS, strict=False):
        known = [
            (one.values[nodes] / LENGTH, load)
            for one, load in zip(bent, ELASTICA_LOADS, strict=False)
            if nodes in one.values
        ]
        if known:
            axes.plot(*zip(*known, strict=True), "o", color=colour, markersize=4.5, label=f"{nodes} nodes")
    axes.legend(frameon=False, fontsize=8.0)
    style_axes(axes, x_label="height of the tip / length", y_label="tip load F L^2 / (E I)")
    axes = figure.add_axes((0.68, bottom, 0.30, top - bottom))
    place = np.arange(len(found))[::-1]
    for nodes, colour in zip(meshes, LINE_COLOURS, strict=False):
        points = [
            (max(abs(100.0 * one.errors[nodes]), _SMALLEST), y)
            for one, y in zip(found, place, strict=True)
            if nodes in one.errors
        ]
        axes.plot(*zip(*points, strict=True), "o", color=colour, markersize=4.5, label=f"{nodes} nodes")
    axes.axvline(TARGET, color=SOFT_INK, linewidth=1.0, linestyle=(0, (5, 4)))
    axes.set_xscale("log")
    labels = [f"{one.name}   ({one.limit})" if one.limit else one.name for one in found]
    style_axes(axes, x_label="magnitude of the error [%]", y_label="")
    axes.set_yticks(place, labels)
    axes.legend(frameon=False, fontsize=8.0, loc="lower left")
    note = "dashes: 2 %, asked at 33 nodes   in brackets: known limit of lattice or reference"
    add_title(figure, "The material against classical mechanics and finite elements", note)
    return figure

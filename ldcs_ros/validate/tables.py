"""Results as tables for terminals and Markdown: Table I, the models compared, the fit and its confidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ldcs_ros.validate import paper
from ldcs_ros.validate.benchmark import Benchmark
from ldcs_ros.validate.calibration import OBSERVATIONS, Fit, target
from ldcs_ros.validate.cases import ComparedModel
from ldcs_ros.validate.identifiability import Confidence, Direction, Sensitivity, Structure
from ldcs_ros.validate.parameters import Parameter
from ldcs_ros.validate.transient import Damped

Rows = list[list[str]]

_MOST_DIRECTIONS = 6


def signed(value: float, digits: int) -> str:
    """Return a number with sign and a fixed number of digits; a rounded zero has no sign."""
    rounded = round(float(value), digits)
    return f"{rounded:+.{digits}f}" if rounded else f"{0.0:.{digits}f}"


def plausible_range(parameter: Parameter) -> str:
    """Return half the width of a parameter's plausible range, in handy units."""
    return quantity(parameter.spread, parameter.unit)


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a value with its unit; lengths in mm and masses in g."""
    scale, shown = {"m": (1e3, "mm"), "kg": (1e3, "g")}.get(unit, (1.0, unit))
    return f"{scale * value:.{digits}g} {shown}".strip()


def table_one(case: ComparedModel) -> Rows:
    """Return Table I with a case in its first column [mm]: head, then a row a point and axis."""
    rows = [["", "ours", "paper's model", "experiment", "our error", "paper's error"]]
    ours = paper.errors(case.rest.displacement)
    for name in paper.POINTS:
        for index, axis in enumerate(paper.AXES):
            model, experiment = paper.MODEL[name][index], paper.EXPERIMENT[name][index]
            rows.append(
                [
                    f"{name} u{axis}",
                    signed(case.rest.displacement[name][index], 2),
                    signed(model, 1),
                    signed(experiment, 1),
                    signed(ours[name][index], 2),
                    signed(model - experiment, 1),
                ]
            )
    return rows


def comparison(cases: Sequence[ComparedModel]) -> Rows:
    """Return a row a model: errors against the experiment [mm], the largest, radius, torque."""
    rows = [["model", "P0 ux", "P0 uz", "P1 ux", "P1 uz", "worst", "r [mm]", "joint torque"]]
    for case in cases:
        error = paper.errors(case.rest.displacement)
        four = [error["P0"][0], error["P0"][2], error["P1"][0], error["P1"][2]]
        rows.append(
            [
                case.title,
                *(signed(value, 2) for value in four),
                f"{paper.worst(case.rest.displacement):.2f}",
                f"{1e3 * case.rest.radius:.1f}",
                "-" if case.torque is None else f"{case.torque:.4f} N m",
            ]
        )
    model = [paper.MODEL[n][i] - paper.EXPERIMENT[n][i] for n in paper.POINTS for i in (0, 2)]
    largest = max(map(abs, model))
    rows.append(
        ["the paper's own model", *(signed(value, 1) for value in model), f"{largest:.1f}", "115", "-"]
    )
    return rows


def fitted(values: dict[str, float], parameters: Sequence[Parameter], confidence: Confidence) -> Rows:
    """Return a row a fitted parameter: value, standard deviation, bounds, origin of the bounds."""
    rows = [["fitted", "value", "std dev", "bounds", "why these bounds"]]
    for p in parameters:
        bounds = f"{quantity(p.low, p.unit)} ... {quantity(p.high, p.unit)}"
        deviation = quantity(confidence.deviation[p.short], p.unit, 2)
        rows.append([p.short, quantity(values[p.path], p.unit), deviation, bounds, p.origin])
    return rows


def structures(found: Sequence[tuple[Structure, Fit]]) -> Rows:
    """Return a row a structure: fitted values, errors [mm], misfit."""
    rows = [["structure", *OBSERVATIONS, "worst", "chi2", "fitted"]]
    for structure, result in found:
        error = result.seen - target()
        names = {p.path: (p.short, p.unit) for p in structure.parameters}
        values = ", ".join(
            f"{names[path][0]} {quantity(v, names[path][1], 3)}" for path, v in result.values.items()
        )
        worst = f"{np.abs(error[:4]).max():.2f}"
        rows.append([structure.title, *(signed(e, 2) for e in error), worst, f"{result.misfit:.0f}", values])
    return rows


def profiled(parameter: Parameter, found: Sequence[tuple[float, Fit]]) -> Rows:
    """Return a row a held value: the others' best fit."""
    rows = [[f"{parameter.short} held", *OBSERVATIONS, "chi2"]]
    for value, result in found:
        error = [signed(e, 2) for e in result.seen - target()]
        rows.append([quantity(value, parameter.unit), *error, f"{result.misfit:.0f}"])
    return rows


def directions(found: Sequence[Direction]) -> Rows:
    """Return a row a direction: strength, and the parameters that it mixes."""
    rows = [["strength", "determined by the data", "direction (in plausible ranges)"]]
    for item in found[:_MOST_DIRECTIONS]:
        parts = sorted(item.weights.items(), key=lambda pair: -abs(pair[1]))
        words = ", ".join(f"{signed(weight, 2)} {name}" for name, weight in parts if abs(weight) > 0.2)
        rows.append([f"{item.strength:.3g}", "yes" if item.strength > 1.0 else "no", words])
    left = len(found) - _MOST_DIRECTIONS
    if left > 0:
        rows.append(["0", "no", f"{left} more"])
    return rows


def sensitivity(found: Sequence[Sensitivity]) -> Rows:
    """Return a row a parameter: change of the data [mm] alone, and at a held radius."""
    heads = [f"{name}" for name in OBSERVATIONS]
    rows = [["parameter", "grows by", *heads, *(f"{name}, r held" for name in heads[:4])]]
    for item in found:
        alone, held = ([signed(v, 2) for v in values] for values in (item.alone, item.held[:4]))
        rows.append([item.parameter.short, plausible_range(item.parameter), *alone, *held])
    return rows


def damping(runs: Sequence[Damped]) -> Rows:
    """Return a row a damping: settling, overshoot, steps, cost and error."""
    rows = [["c [N s/m]", "settled after [s]", "overshoot [mm]", "steps for 3 s", "cost", "error [um]"]]
    base = next((run.transient.wall_time for run in runs if run.damping == 5.0), runs[0].transient.wall_time)
    for run in runs:
        late = "not within 3" if np.isinf(run.transient.settling) else f"{run.transient.settling:.2f}"
        cost = f"{run.transient.wall_time / base:.1f}"
        rows.append(
            [
                f"{run.damping:g}",
                late,
                f"{run.transient.overshoot:.1f}",
                str(run.transient.steps),
                cost,
                f"{1e6 * run.error:.2g}",
            ]
        )
    return rows


def as_text(rows: Rows) -> str:
    """Return rows in aligned columns, numbers to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column == 0 or len(cell) > 16 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def as_markdown(rows: Rows) -> str:
    """Return rows as a Markdown table."""
    head, *body = ["| " + " | ".join(row) + " |" for row in rows]
    rule = "|---|" + "---:|" * (len(rows[0]) - 1)
    return "\n".join([head, rule, *body])


def mechanics(found: Sequence[Benchmark]) -> list[list[str]]:
    """Return the rows of the comparison with classical mechanics: errors by number of nodes, order, known limits."""
    meshes = sorted({nodes for one in found for nodes in one.values})
    rows = [["quantity", "reference", *(f"error at {n} nodes" for n in meshes), "order", "known limit"]]
    for one in found:
        errors = [f"{100.0 * one.errors[n]:+.2f} %" if n in one.errors else "" for n in meshes]
        order = f"{one.order:.1f}" if one.order > 0.0 else "-"
        rows.append([one.name, f"{one.reference:.5g}", *errors, order, one.limit])
    return rows

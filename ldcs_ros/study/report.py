"""The study in words: tables in Markdown and a recommendation, all taken from the rows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.study import sections
from ldcs_ros.study.diagram import short_reason
from ldcs_ros.study.markdown import table
from ldcs_ros.study.problems import ERROR_TIMES
from ldcs_ros.study.promise import ACCURACIES
from ldcs_ros.study.recommendation import DEFAULT, TARGETS, cheapest, curves, recommendation
from ldcs_ros.study.spatial import against_finest
from ldcs_ros.study.targets import PROMISED_FACTOR, PROMISED_SHARE, promised
from ldcs_ros.study.tasks import BASELINE, METHODS_APART, Row


def report(rows: Sequence[Row], *, machine: dict[str, str], commands: Sequence[str], picture: str) -> str:
    """Return the whole study as Markdown.

    Args:
        rows: The study's rows.
        machine: Hardware and versions.
        commands: What made it, in that order.
        picture: Path of the diagram, relative to the text.
    """
    parts = [
        "# What accuracy costs in time",
        f"Made by {' and then '.join(f'`{command}`' for command in commands)}, with everything in one process on one "
        f"thread side by side unless it says `--jobs`; the numbers are in `study.csv`. CPU time is the best of "
        f"several runs, so ratios mean more than times. The error is the largest distance of any node coordinate "
        f"from a reference (`esdirk43` at 1e-9 m; 1e-8 m for 65 x 65, 1e-7 m for 129 x 129) at t = 0.5, 1, 2 and 3 s.",
        table(("", ""), [(name, value) for name, value in machine.items()]),
        "## Recommendation",
        recommendation(rows),
        f"![CPU time against error for each method, scene and lattice]({picture})",
        "## Targets",
        *sections.target_table(rows),
        "## Time to reach an error",
        "CPU milliseconds per simulated second of the cheapest setting whose real error is at most this; "
        "`-`: none tried is.",
        *_cost_tables(rows),
        _as_compiled_loops(rows),
        "## Methods",
        _methods(),
        "## Asked and real accuracy",
        *_promise(rows),
        "## What effects cost",
        *_effects(rows),
        "## Large lattices",
        *sections.large_lattices(rows),
        "## Commands at a rate",
        *sections.command_rates(rows),
        "## The lattice's own error",
        *_spatial(rows),
        "## Orders on the stiff sheet",
        *sections.measured_orders(rows),
        "## A fourth-order stabilised method",
        *sections.fourth_order_bound(rows),
        "## Without a result",
        *_failures(rows),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def promise_is_kept(rows: Sequence[Row]) -> bool:
    """Return whether the promised share of (scene, accuracy) pairs is within what was asked, and none far
    off."""
    _, share, worst = promised(rows)
    return share >= PROMISED_SHARE and worst <= PROMISED_FACTOR


def _cost_tables(rows: Sequence[Row]) -> list[str]:
    tables = []
    for (scene, nodes), methods in sorted(curves(rows).items()):
        lines = []
        names = [*INTEGRATORS, *METHODS_APART]
        for name in sorted(methods, key=names.index):
            best = [cheapest(methods[name], target) for target in TARGETS]
            lines.append((f"`{name}`", *("-" if row is None else f"{1e3 * row.cpu:.3g}" for row in best)))
        tables.append(f"**{scene}, {nodes} x {nodes}**")
        tables.append(table(("method", *(f"{target:.0e} m" for target in TARGETS)), lines))
    return tables


def _as_compiled_loops(rows: Sequence[Row]) -> str:
    """Return what the explicit methods would cost as one compiled loop: they are slow by their count, not
    by Python."""
    methods = curves(rows).get(("arc", 9), {})
    baseline = [row for row in methods.get(BASELINE, []) if not row.failure]
    best = cheapest(methods.get(DEFAULT, []), 1e-5)
    if not baseline or best is None:
        return ""
    evaluation = min(row.cpu * ERROR_TIMES[-1] / row.evaluations for row in baseline)
    parts = []
    for name in ("rk4", "semi_implicit_euler", "rkc2"):
        row = cheapest(methods.get(name, []), 1e-5)
        if row is not None:
            loop = evaluation * row.evaluations / ERROR_TIMES[-1]
            parts.append(f"`{name}` {1e3 * loop:.3g} ms ({loop / best.cpu:.0f} times `{DEFAULT}`)")
    return (
        f"Our methods are Python around compiled kernels. Were each explicit one a compiled loop like the "
        f"baseline, whose "
        f"evaluation takes {1e6 * evaluation:.1f} us, an error of 1e-5 m on `arc` 9 x 9 would take "
        f"{', '.join(parts)}."
    )


def _methods() -> str:
    import inspect

    from ldcs_ros.errors import SolverError
    from ldcs_ros.integrators import integrator_class
    from ldcs_ros.study.problems import scene_of

    lines = []
    for name in INTEGRATORS:
        kind = integrator_class(name)
        scene = scene_of("arc_axiswise" if name == "exponential" else "arc", 9)
        simulation = scene.build()
        try:
            limit = kind(simulation.model).stability_limit(simulation.motion(), simulation.inputs.held())
        except SolverError:
            limit = math.nan
        module = inspect.getmodule(kind)
        first = (inspect.getdoc(module) or "").splitlines()[0]
        lines.append((f"`{name}`", str(kind.order), "none" if math.isinf(limit) else f"{limit:.3g} s", first))
    return table(("method", "order", "longest stable step, `arc` 9 x 9", "what it is"), lines)


def _promise(rows: Sequence[Row]) -> list[str]:
    made = [row for row in rows if row.kind == "promise" and not row.failure]
    if not made:
        return ["Not measured."]
    factors = [row.error / row.value for row in made]
    within = sum(factor <= 1.0 for factor in factors) / len(factors)
    worst = max(zip(factors, made, strict=True), key=lambda pair: pair[0])
    lines = []
    for scene in sorted({row.scene for row in made}):
        by = {row.value: row.error for row in made if row.scene == scene}
        lines.append((f"`{scene}`", *(f"{by[a] / a:.2f}" if a in by else "-" for a in ACCURACIES)))
    kept = promise_is_kept(rows)
    text = (
        f"Real error, compared 50 times a simulated second, as a share of what `accuracy` asked for. "
        f"{100 * within:.0f} % of "
        f"{len(made)} pairs are within it; the worst is {worst[0]:.2f} times it (`{worst[1].scene}` at "
        f"{worst[1].value:.0e} m). "
        f"Promised are {100 * PROMISED_SHARE:.0f} % and {PROMISED_FACTOR:g} times: "
        f"{'kept' if kept else '**not kept**'}."
    )
    return [text, table(("scene", *(f"{a:.0e} m" for a in ACCURACIES)), lines)]


def _effects(rows: Sequence[Row]) -> list[str]:
    made = [row for row in rows if row.kind == "effect" and not row.failure]
    parts: list[str] = []
    for scene in sorted({row.scene for row in made}):
        of_scene = {row.setting: row for row in made if row.scene == scene}
        whole = of_scene.pop("none", None)
        if whole is None:
            continue
        evaluations, jacobians = whole.evaluations / whole.steps, whole.factorisations / whole.steps
        all_force, all_jacobian, step = (float(word) for word in whole.extra.split()[1::2])
        lines = []
        for name, row in of_scene.items():
            force, jacobian = (float(word) for word in row.extra.split()[1::2])
            saved = all_force - force, all_jacobian - jacobian
            share = evaluations * saved[0] + jacobians * saved[1]
            lines.append((f"`{name}`", f"{saved[0]:.2f}", f"{saved[1]:.1f}", f"{share:.0f}"))
        lines.append(("all of them", f"{all_force:.2f}", f"{all_jacobian:.1f}", f"{step:.0f}"))
        parts += [
            f"**{scene}** with drag, floor and a point force added: how many microseconds less a force evaluation and "
            f"a Jacobian take when one effect is left out of the scene, and what that comes to in a step of "
            f"`{whole.method}`, which takes {evaluations:.1f} evaluations and {jacobians:.2f} Jacobians here (the last "
            f"line is the whole step, linear algebra included). A model holds only what its scene names: an effect "
            f"that is absent costs nothing.",
            table(("effect", "force [us]", "Jacobian [us]", "step [us]"), lines),
        ]
    return parts or ["Not measured."]


def _spatial(rows: Sequence[Row]) -> list[str]:
    errors = against_finest([*rows])
    if not errors:
        return ["Not measured."]
    costs = {row.nodes: row.cpu for row in rows if row.kind == "spatial" and not row.failure}
    text = (
        f"Scene `arc_material`, whose springs are scaled from a modulus: P0 and P1 at the four times against "
        f"those of "
        f"{max(costs)} x {max(costs)} nodes, at an error in time of 1e-6 m. A finer accuracy in time than a "
        f"tenth of this is "
        f"wasted on the lattice."
    )
    sizes = sorted(costs)
    lines = []
    for before, n in zip([0, *sizes], sizes, strict=False):
        error = f"{1e3 * errors[n]:.3f}" if n in errors else "finest"
        growth = math.log(costs[n] / costs[before]) / math.log((n / before) ** 2) if before else math.nan
        lines.append((f"{n} x {n}", error, f"{1e3 * costs[n]:.3g}", f"{growth:.2f}" if before else "-"))
    head = (
        "nodes",
        "lattice's error [mm]",
        "CPU ms per simulated second",
        "cost grows as nodes to the power",
    )
    return [text, table(head, lines)]


def _failures(rows: Sequence[Row]) -> list[str]:
    checks = [row for row in rows if row.kind == "check" and not row.failure]
    parts = [
        f"The reference itself was checked against SciPy's Radau (`{row.scene}`, {row.nodes} x {row.nodes}, "
        f"tolerance for "
        f"{row.value:.0e} m): they differ by {row.error:.1e} m."
        for row in checks
    ]
    lines = [
        (
            f"`{row.scene}` {row.nodes} x {row.nodes}",
            f"`{row.method}`",
            f"{row.setting} {row.value:g}",
            short_reason(row.failure),
        )
        for row in rows
        if row.failure
    ]
    return [
        *parts,
        table(("problem", "method", "setting", "why"), lines) if lines else "Everything had a result.",
    ]

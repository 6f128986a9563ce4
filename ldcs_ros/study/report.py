"""The report of a study: tables in Markdown and a recommendation, all computed from the rows."""

from __future__ import annotations

import inspect
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

from ldcs_ros.errors import SolverError
from ldcs_ros.integrators import INTEGRATORS, integrator_class
from ldcs_ros.study.accuracy_check import ACCURACIES, MAX_FACTOR, MIN_FRACTION, accuracy_summary
from ldcs_ros.study.command_rates import ACCURACY, SMOOTH, rate_costs
from ldcs_ros.study.drive_profiles import PERIOD
from ldcs_ros.study.problems import ERROR_TIMES, scene_of
from ldcs_ros.study.recommendation import TARGETS, cheapest, curves, recommendation
from ldcs_ros.study.rows import METHODS_APART, Row
from ldcs_ros.study.scaling import exponents, measured_sizes, peak_memory
from ldcs_ros.study.spatial_convergence import errors_against_finest
from ldcs_ros.study.targets import NAMES, targets
from ldcs_ros.study.verified_runs import ACCURACY as VERIFIED_ACCURACY
from ldcs_ros.study.verified_runs import LOOKS, verification_costs

# Errors between rounding and coarseness: their slope is the order.
ORDER_ERRORS = (3e-8, 1e-3)  # m
ORDER_FRACTION = 0.85


def report(rows: Sequence[Row], *, machine: dict[str, str], commands: Sequence[str], picture: str) -> str:
    """Return the whole study as Markdown.

    Args:
        rows: The study's rows.
        machine: Hardware and versions.
        commands: The commands that made the rows, in their order.
        picture: Path of the diagram, relative to the text.
    """
    parts = [
        "# What accuracy costs in time",
        f"Made by {' and then '.join(f'`{command}`' for command in commands)}, in one process on one thread unless a "
        f"command has `--jobs`; the numbers are in `study.csv`. CPU time is the best of several runs: ratios mean more "
        f"than times. The error is the largest distance of any node coordinate from a reference (`esdirk43` at "
        f"1e-9 m; 1e-8 m for 65 x 65, 1e-7 m for 129 x 129) at t = 0.5, 1, 2 and 3 s.",
        markdown_table(("", ""), machine.items()),
        "## Recommendation",
        recommendation(rows),
        f"![CPU time against error for each method, scene and lattice]({picture})",
    ]
    for title, section in {
        "Targets": _targets,
        "Time to reach an error": _costs,
        "Methods": methods,
        "Asked and real accuracy": _accuracy,
        "Verified runs": _verified,
        "What effects cost": _effects,
        "Large lattices": _large_lattices,
        "Commands at a rate": command_rate_section,
        "Environments for learning": _learning,
        "The lattice's own error": _spatial,
        "Orders on the stiff sheet": _orders,
        "Without a result": _failures,
    }.items():
        parts += [f"## {title}", *(list(section(rows)) or ["Not measured by this preset."])]
    return "\n\n".join(parts) + "\n"


def markdown_table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table with a head and lines of cells."""
    text = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join([*text, *(f"| {' | '.join(line)} |" for line in lines)])


def _size(nodes: int) -> str:
    return f"{nodes} x {nodes}"


def _targets(rows: Sequence[Row]) -> Iterator[str]:
    yield "`ldcs study --targets` measures these alone. CPU time of one thread."
    head = ("target", "asked", "reached", "verdict", "others, CPU time in the same run")
    yield markdown_table(
        head,
        [
            (
                target.name,
                target.asked,
                target.reached,
                f"**{target.verdict}**" if target.met is False else target.verdict,
                target.others or "-",
            )
            for target in targets(rows)
        ],
    )


def _costs(rows: Sequence[Row]) -> Iterator[str]:
    yield (
        "CPU milliseconds per simulated second of the cheapest setting whose real error is at most this; `-`: none "
        "of the settings is."
    )
    names = [*INTEGRATORS, *METHODS_APART]
    for (scene, nodes), made in sorted(curves(rows).items()):
        yield f"**{scene}, {_size(nodes)}**"
        lines = []
        for name in sorted(made, key=names.index):
            best = [cheapest(made[name], target) for target in TARGETS]
            lines.append((f"`{name}`", *("-" if row is None else f"{1e3 * row.cpu:.3g}" for row in best)))
        yield markdown_table(("method", *(f"{target:.0e} m" for target in TARGETS)), lines)


def methods(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the table of our methods, whatever the rows."""
    lines = []
    for name in INTEGRATORS:
        kind = integrator_class(name)
        simulation = scene_of("arc_axiswise" if name == "exponential" else "arc", 9).build()
        try:
            limit = kind(simulation.model).stability_limit(simulation.motion(), simulation.inputs.held())
        except SolverError:
            limit = math.nan
        first = (inspect.getdoc(inspect.getmodule(kind)) or "").splitlines()[0]
        lines.append((f"`{name}`", str(kind.order), "none" if math.isinf(limit) else f"{limit:.3g} s", first))
    yield markdown_table(("method", "order", "longest stable step, `arc` 9 x 9", "description"), lines)


def _accuracy(rows: Sequence[Row]) -> Iterator[str]:
    made = [row for row in rows if row.kind == "accuracy" and not row.failure]
    if not made:
        return
    found, worst = accuracy_summary(rows), max(made, key=lambda row: row.error / row.value)
    yield (
        f"Real error over asked error, compared 50 times per simulated second. {100 * found.within:.0f} % of "
        f"{found.pairs} pairs are within 1; the worst is {worst.error / worst.value:.2f} (`{worst.scene}` at "
        f"{worst.value:.0e} m). Asked are {100 * MIN_FRACTION:.0f} % and {MAX_FACTOR:g}: "
        f"{'met' if found.met else '**missed**'}."
    )
    lines = []
    for scene in sorted({row.scene for row in made}):
        by = {row.value: row.error for row in made if row.scene == scene}
        lines.append((f"`{scene}`", *(f"{by[a] / a:.2f}" if a in by else "-" for a in ACCURACIES)))
    yield markdown_table(("scene", *(f"{a:.0e} m" for a in ACCURACIES)), lines)
    yield "Random scenes, violent events, velocities, orientations and joint angles: [accuracy.md](accuracy.md)."


def _verified(rows: Sequence[Row]) -> Iterator[str]:
    costs = verification_costs(rows)
    if not costs:
        return
    yield (
        f"A verified run (`ldcs simulate --verify`, `solver: {{verify: true}}`) has a second solution at a tenth of "
        f"the accuracy beside the first and reports the measured distance. Asked: {VERIFIED_ACCURACY:.0e} m; both "
        f"runs are measured in turns and looked at {LOOKS} times per simulated second."
    )
    head = (
        "scene",
        "plain [CPU ms per simulated second]",
        "verified",
        "ratio",
        "measured error",
        "plain estimate",
    )
    lines = [
        (
            f"`{one.scene}`",
            f"{1e3 * one.plain:.3g}",
            f"{1e3 * one.verified:.3g}",
            f"{one.ratio:.2f}",
            f"{one.measured:.1e} m",
            f"{one.estimated:.1e} m",
        )
        for one in costs
    ]
    yield markdown_table(head, lines)


def _effects(rows: Sequence[Row]) -> Iterator[str]:
    made = [row for row in rows if row.kind == "effect" and not row.failure]
    for scene in sorted({row.scene for row in made}):
        of_scene = {row.setting: row for row in made if row.scene == scene}
        whole = of_scene.pop("none", None)
        if whole is None:
            continue
        evaluations, jacobians = whole.evaluations / whole.steps, whole.factorisations / whole.steps
        all_force, all_jacobian, step = (float(word) for word in whole.extra.split()[1::2])
        yield (
            f"**{scene}** with drag, floor and a point force added: microseconds that a force evaluation and a "
            f"Jacobian save without one effect, and the saving of a step of `{whole.method}` with its "
            f"{evaluations:.1f} evaluations and {jacobians:.2f} Jacobians. The last line is the whole step, linear "
            f"algebra included. An effect that the scene does not name costs nothing."
        )
        lines = []
        for name, row in of_scene.items():
            force, jacobian = (float(word) for word in row.extra.split()[1::2])
            saved = all_force - force, all_jacobian - jacobian
            of_step = evaluations * saved[0] + jacobians * saved[1]
            lines.append((f"`{name}`", f"{saved[0]:.2f}", f"{saved[1]:.1f}", f"{of_step:.0f}"))
        lines.append(("all of them", f"{all_force:.2f}", f"{all_jacobian:.1f}", f"{step:.0f}"))
        yield markdown_table(("effect", "force [us]", "Jacobian [us]", "step [us]"), lines)


def _large_lattices(rows: Sequence[Row]) -> Iterator[str]:
    made = measured_sizes(rows)
    if not made:
        return
    fitted, ends = exponents(made)
    yield (
        f"Scene `{made[0].scene}`, whose material stays the same, at {made[0].value:.0e} m in time, all of its "
        f"{ERROR_TIMES[-1]:g} s. Each size runs in a process of its own; peak memory includes Python and all "
        f"libraries. Over all sizes the cost grows as nodes to the power {fitted:.2f} (least squares), {ends:.2f} "
        f"(end to end)."
    )
    head = ("nodes", "CPU s per simulated second", "nodes to the power", "steps", "evaluations", "factorings")
    lines = []
    for before, row in zip([None, *made], made, strict=False):
        growth = "-" if before is None else f"{exponents([before, row])[1]:.2f}"
        counts = str(row.steps), str(row.evaluations), str(row.factorisations)
        lines.append((_size(row.nodes), f"{row.cpu:.3g}", growth, *counts, f"{peak_memory(row):.0f}"))
    yield markdown_table((*head, "peak MiB"), lines)


def command_rate_section(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the cost of command rates beside a profile that is followed without steps."""
    costs = rate_costs(rows)
    if not costs:
        return
    yield (
        f"The profile (1 - cos(2 pi t / {PERIOD:g} s)) / 2 of the scene's full drive is sampled at the rate and sent "
        f"as steps, as a rig's controller does: pressures on `rig`, torques on `paper`, a vertical force on the loaded "
        f"node of `arc` (`arc_pushed`). Smooth: the drive follows the profile itself. One period at "
        f"`accuracy: {ACCURACY:g}`; the error is against the same commands at a hundredth of it, 50 times per "
        f"simulated second."
    )
    lines = []
    for (scene, rate), cost in costs.items():
        row, others = cost.row, [cost.others.get(name) for name in NAMES]
        lines.append(
            (
                f"`{scene}`",
                "smooth" if rate == SMOOTH else f"{rate:g} Hz",
                f"{1e3 * row.cpu:.3g}",
                f"{cost.speed:.2f}",
                f"{row.error:.1e} m",
                f"{row.steps / PERIOD:.0f}",
                f"{row.factorisations / PERIOD:.0f}",
                *("-" if other is None else other.failure or f"{1e3 * other.cpu:.3g}" for other in others),
            )
        )
    head = (
        "problem",
        "commands",
        "CPU ms per simulated second",
        "speed of smooth",
        "error",
        "steps per second",
    )
    labels = (f"{label} [ms]" for label in NAMES.values())
    yield markdown_table((*head, "factorings per second", *labels), lines)


def _learning(rows: Sequence[Row]) -> Iterator[str]:
    lines = []
    for row in rows:
        if row.kind == "learning" and not row.failure:
            _, period, _, solved = row.extra.split(maxsplit=3)
            step = row.cpu * float(period)
            speed = (f"{1e3 * step:.2f}", f"{1.0 / step:.0f}", f"{1.0 / row.cpu:.1f}")
            lines.append((row.method, f"`{row.scene}`", *speed, solved))
    if lines:
        yield "The baseline in one environment, its resets included; `ldcs gym` measures several processes."
        yield markdown_table(
            ("task", "scene", "CPU of a step [ms]", "steps per CPU s", "times real time", "episodes solved"),
            lines,
        )


def _spatial(rows: Sequence[Row]) -> Iterator[str]:
    errors = errors_against_finest(rows)
    if not errors:
        return
    costs = {row.nodes: row.cpu for row in rows if row.kind == "spatial" and not row.failure}
    sizes = sorted(costs)
    yield (
        f"Scene `arc_material`, whose springs are scaled from a modulus: P0 and P1 at the four times against those of "
        f"{_size(sizes[-1])} nodes, at an error in time of 1e-6 m. An accuracy in time below a tenth of this is "
        f"wasted on the lattice."
    )
    lines = []
    for before, n in zip([0, *sizes], sizes, strict=False):
        error = f"{1e3 * errors[n]:.3f}" if n in errors else "finest"
        growth = math.log(costs[n] / costs[before]) / math.log((n / before) ** 2) if before else math.nan
        lines.append((_size(n), error, f"{1e3 * costs[n]:.3g}", f"{growth:.2f}" if before else "-"))
    head = (
        "nodes",
        "lattice's error [mm]",
        "CPU ms per simulated second",
        "cost grows as nodes to the power",
    )
    yield markdown_table(head, lines)


def convergence_orders(rows: Sequence[Row]) -> dict[str, list[tuple[float, float, float]]]:
    """Return, by method, (longer step [s], shorter step [s], order between them) on `arc` 9 x 9."""
    made: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if (row.kind, row.scene, row.nodes, row.setting) == ("curve", "arc", 9, "dt") and row.steps:
            if ORDER_ERRORS[0] <= row.error <= ORDER_ERRORS[1] and not row.failure:
                made.setdefault(row.method, []).append((row.value, row.error))
    found: dict[str, list[tuple[float, float, float]]] = {}
    for method, points in made.items():
        points.sort(reverse=True)
        for (long, large), (short, small) in itertools.pairwise(points):
            order = math.log(large / small) / math.log(long / short)
            found.setdefault(method, []).append((long, short, order))
    return found


def mean_order(pairs: Sequence[tuple[float, float, float]]) -> float:
    """Return the order over all of a method's steps: from its longest to its shortest."""
    whole = sum(order * math.log(long / short) for long, short, order in pairs)
    return whole / sum(math.log(long / short) for long, short, _ in pairs)


def _orders(rows: Sequence[Row]) -> Iterator[str]:
    found = convergence_orders(rows)
    if not found:
        return
    yield (
        "From the errors at fixed steps on `arc` 9 x 9; bold: below the order for non-stiff problems. On stiff "
        "problems the stages of a Rosenbrock method are of first order, and with driven edges its order falls to "
        "between 2 and 2.5 (Lubich and Ostermann, Linearly implicit time discretization of non-linear parabolic "
        "equations, IMA J. Numer. Anal. 15, 1995, show this for parabolic equations)."
    )
    lines = []
    for name in (name for name in INTEGRATORS if name in found):
        mean, order = mean_order(found[name]), integrator_class(name).order
        text = f"{mean:.1f}" if mean >= ORDER_FRACTION * order else f"**{mean:.1f}**"
        steps = ", ".join(f"{each:.1f} ({long:g} to {short:g} s)" for long, short, each in found[name])
        lines.append((f"`{name}`", str(order), text, steps))
    yield markdown_table(("method", "order", "measured", "between steps"), lines)


def _failures(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        if row.kind == "check" and not row.failure:
            yield (
                f"The reference itself against SciPy's Radau (`{row.scene}`, {_size(row.nodes)}, tolerance for "
                f"{row.value:.0e} m): they differ by {row.error:.1e} m."
            )
    lines = [
        (
            f"`{row.scene}` {_size(row.nodes)}",
            f"`{row.method}`",
            f"{row.setting} {row.value:g}",
            short_reason(row.failure),
        )
        for row in rows
        if row.failure
    ]
    yield (
        markdown_table(("problem", "method", "setting", "reason"), lines)
        if lines
        else "All rows have a result."
    )


def short_reason(failure: str) -> str:
    """Return a failure in a few words."""
    for sign, words in (
        ("too slow", failure.split(" by its")[0].replace(" per simulated second", " per s")),
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
